"""GPS models on one front end run."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from shared_runs import written_by_command

import vgps
from scripts.common.drives import VideoSection
from vgps.compare import ALL_METHODS, METHODS, Method, compare
from vgps.compare.methods import front_ends
from vgps.config import Config, SensorsConfig
from vgps.errors import TrajectoryError
from vgps.readers.calibration.rig_file import read_rig
from vgps.runtime.progress import NoProgress

CHOSEN = [METHODS[1], METHODS[4]]


@pytest.fixture(scope="module")
def comparison(brief):
    opened = vgps.open_recording(brief)
    return compare(opened, brief / "truth.tum", Config(), NoProgress(), CHOSEN)


def test_methods_are_those_of_the_thesis_and_a_robust_one():
    assert [method.key for method in ALL_METHODS] == [
        "none",
        "gaussian",
        "gaussian-receiver",
        "ellipsoid",
        "cylinder",
        "cauchy",
        "cylinder-independent",
    ]


def test_a_method_is_configured_by_both_its_models():
    found = [method.configured(Config()).gps for method in ALL_METHODS]
    assert [(gps.model, gps.error_model) for gps in found] == [(m.model, m.error_model) for m in ALL_METHODS]
    assert [gps.has_memory for gps in found] == [False, False, False, True, True, False, False]


@pytest.mark.slow
def test_every_method_poses_every_frame_and_only_the_model_differs(comparison, smoothed_brief):
    assert list(comparison.evaluations) == [method.name for method in CHOSEN]
    assert all(one.every_frame_posed for one in comparison.evaluations.values())
    assert comparison.evaluations["cylinder (16)"].camera_position_m.mean < 0.1
    smoothed = written_by_command(smoothed_brief)
    np.testing.assert_array_equal(comparison.paths["cylinder (16)"], smoothed.world_T_camera[:, :3, 3])


def test_all_methods_share_a_clock_that_is_wrong_by_seconds(recording, monkeypatch):
    """The search for it has its own tests in tests/pipeline/test_gps_clock.py; here it is given."""
    right = Config(sensors=SensorsConfig(time_offset_s=3.0))
    monkeypatch.setattr("vgps.compare.methods.run_front_end", lambda *_: ["wrong"])
    monkeypatch.setattr(
        "vgps.compare.methods.with_right_clock", lambda found, *_: (["right, not", *found], right)
    )
    for name in ("with_right_speed", "with_right_roll"):
        monkeypatch.setattr(f"vgps.compare.methods.{name}", lambda found, config, _: (found, config))
    rows = list(front_ends(vgps.open_recording(recording), Config(), NoProgress(), METHODS[1:3]))
    assert rows[0][0] == ["right, not", "wrong"] and rows[0][0] is rows[1][0]
    assert [settings.sensors.time_offset_s for *_, settings in rows] == [3.0, 3.0]
    assert [settings.gps.model for _, _, settings in rows] == ["gaussian", "gaussian-receiver"]


def test_a_drones_camera_flies_by_every_method_as_in_a_run(recording, monkeypatch):
    monkeypatch.setattr("vgps.compare.methods.run_front_end", lambda *_: None)
    for name in ("with_right_speed", "with_right_clock", "with_right_roll"):
        monkeypatch.setattr(f"vgps.compare.methods.{name}", lambda front, config, _: (front, config))
    opened = vgps.open_recording(recording)
    drone = replace(opened, gps=replace(opened.gps, airborne=True))
    assert all(settings.start.flies for *_, settings in front_ends(drone, Config(), NoProgress(), METHODS))


@pytest.mark.slow
def test_the_method_without_gps_begins_at_the_true_poses(recording):
    opened = vgps.open_recording(recording)
    section = replace(opened, video=VideoSection(opened.video, 0, 59))
    found = compare(section, recording / "truth.tum", Config(), NoProgress(), METHODS[:1])
    error = np.linalg.norm(found.evaluations["A video only"].camera_error_m, axis=1)
    assert error[:30].mean() < 0.1 and error[-1] > error[:30].mean()


@pytest.mark.slow
def test_a_truth_with_another_origin_is_an_error(brief, tmp_path):
    (tmp_path / "truth.tum").write_bytes((brief / "truth.tum").read_bytes())
    rig = yaml.safe_load((brief / "rig.yaml").read_text())
    origin = read_rig(brief / "rig.yaml").world_origin
    rig["world_origin"] = [origin.latitude_deg, origin.longitude_deg, origin.height_m + 5.0]
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump(rig))
    opened = vgps.open_recording(brief)
    with pytest.raises(TrajectoryError, match="world_origin"):
        compare(opened, tmp_path / "truth.tum", Config(), NoProgress(), [Method("cylinder", "cylinder")])
