"""Rolling shutters that are not known: simulated, of a phone, and none at all."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from brief_videos import first_frames
from fewer_features import fewer_features
from solutions import short_drive

import vgps
from vgps.config import RollingShutterConfig
from vgps.pipeline import readout_estimation
from vgps.pipeline.readout_estimation import with_readout
from vgps.smoothing.calibration.readout import Readout
from vgps.writers.run_folder import write_run

FEWER_FEATURES = fewer_features(200)


def smoothed(recording: vgps.Recording, **settings: str) -> vgps.Solution:
    readout = RollingShutterConfig.model_validate(settings)
    return vgps.smooth(recording, FEWER_FEATURES.model_copy(update={"rolling_shutter": readout}))


def with_known(recording: vgps.Recording, readout_s: float | None) -> vgps.Recording:
    return replace(recording, camera=replace(recording.camera, readout_s=readout_s))


def position_error(solution: vgps.Solution, folder: Path) -> float:
    report = vgps.evaluate(solution, folder / "truth.tum")
    return float(report.camera_position_m.mean)


@pytest.mark.slow
def test_a_known_and_an_unknown_readout_help_alike(shaken: Path, tmp_path: Path) -> None:
    opened = vgps.open_recording(shaken)
    known = smoothed(opened)
    assert known.camera.readout_s == 0.03 and "readout_s" not in known.sensors.camera_sigma
    unknown = with_known(opened, None)
    ignored, found = (smoothed(unknown, estimate=estimate) for estimate in ("no", "auto"))
    assert ignored.camera.readout_s is None
    assert found.camera.readout_s == pytest.approx(0.03, abs=3e-3)
    assert abs(found.camera.readout_s - 0.03) < 4 * found.sensors.camera_sigma["readout_s"]
    assert any("the shutter rolls: 3" in warning or "rolls: 2" in warning for warning in found.warnings)
    write_run(found, tmp_path / "run")
    assert (
        yaml.safe_load((tmp_path / "run" / "camera.yaml").read_text())["readout_s"] == found.camera.readout_s
    )
    graph, values = vgps.factor_graph(tmp_path / "run")
    assert graph.error(values) == pytest.approx(sum(found.report.cost_after.values()), rel=1e-6)
    errors = [position_error(solution, shaken) for solution in (known, found, ignored)]
    assert errors[1] < 1.2 * errors[0] and errors[2] > 1.5 * errors[0]


@pytest.mark.slow
def test_a_phone_has_a_rolling_shutter_and_kitti_none(data_dir: Path, kitti07_fixed: vgps.Solution) -> None:
    phone = smoothed(first_frames(vgps.open_recording(data_dir / "phone_gyro"), 55))
    assert 0.028 < (phone.camera.readout_s or 0.0) < 0.034  # 33 ms from frame to frame
    sensors = kitti07_fixed.sensors
    assert kitti07_fixed.camera.readout_s is None and "readout_s" not in sensors.camera_sigma


def test_what_is_said_of_a_readout() -> None:
    drive = short_drive()
    config = vgps.Config()
    silent = with_readout(drive, Readout(1e-3, 2e-3, 1 / 30), None, config)
    assert silent is drive
    blind = with_readout(drive, Readout(2e-3, 8e-3, 1 / 30), None, config).warnings[-1]
    assert "does not show whether the shutter rolls (estimate 2.0 ms, standard deviation 8.0 ms)" in blind
    rolling = with_readout(drive, Readout(0.03, 1e-3, 1 / 30), 0.03, config)
    assert rolling.camera.readout_s == 0.03 and rolling.sensors.camera_sigma["readout_s"] == 1e-3
    assert (
        "the shutter rolls: 30.0 ms from first to last row (sigma 1.0); camera.yaml" in rolling.warnings[-1]
    )
    chance = with_readout(drive, Readout(3e-3, 1e-3, 1 / 30), 3e-3, config).warnings[-1]
    assert "which may be chance" in chance


@pytest.mark.slow
def test_a_readout_of_the_wrong_sign_is_told(shaken: Path) -> None:
    wrong = with_known(first_frames(vgps.open_recording(shaken), 45), -0.03)
    (note,) = (each for each in smoothed(wrong).warnings if "readout" in each)
    assert "has a readout of -30.0 ms, and the video shows" in note and "negative if" in note


def test_a_known_readout_is_compared_with_what_the_video_shows(monkeypatch: pytest.MonkeyPatch) -> None:
    drive, config = short_drive(), vgps.Config()
    rolling = replace(drive, camera=replace(drive.camera, readout_s=0.02))
    front_end, batch = SimpleNamespace(others=()), SimpleNamespace()

    def told(solution: vgps.Solution, settings: vgps.Config = config) -> int:
        found = readout_estimation.with_contradicted_readout(solution, batch, front_end, settings)
        return len(found.warnings) - len(solution.warnings)

    for seen_s, expected in ((0.021, 0), (-0.019, 1)):
        seen = Readout(seen_s, 1e-3, 1 / 30)
        monkeypatch.setattr(readout_estimation, "_estimate", lambda *given, seen=seen: seen)
        assert told(rolling) == expected
    assert told(rolling, vgps.Config(rolling_shutter=RollingShutterConfig(estimate="no"))) == 0
    assert told(replace(drive, camera=replace(drive.camera, readout_s=None))) == 0
