"""Rolling shutters that the first frames of a video show."""

from dataclasses import replace
from pathlib import Path

import pytest
from recordings import SHAKEN
from solutions import short_drive
from textured_room import path, room_recording

import vgps
from vgps.config import RollingShutterConfig
from vgps.errors import GeometryError
from vgps.model import Recording
from vgps.pipeline import offline
from vgps.pipeline.front_end import run_front_end
from vgps.pipeline.readout_probe import ReadoutProbe, is_confirmed, readout_probe, with_readout_seen
from vgps.runtime.progress import NoProgress
from vgps.simulate import simulate
from vgps.smoothing.calibration.readout import Readout

FRAME_S = 1 / 30
ROLLS, BLIND, GLOBAL = (Readout(*seen, FRAME_S) for seen in ((0.02, 1e-3), (0.02, 5e-3), (1e-3, 1e-3)))


@pytest.fixture
def recording() -> Recording:
    """Whose readout is unknown."""
    given = room_recording(path(5))
    return replace(given, camera=replace(given.camera, readout_s=None))


def looked_at(
    monkeypatch: pytest.MonkeyPatch, recording: Recording, *seen: Readout | vgps.VgpsError
) -> tuple[list[int], ReadoutProbe]:
    """Frames after which a probe looked, which sees one thing after the other; and the probe."""
    looks, coming = [], iter(seen)

    def estimate(self: ReadoutProbe, frames: int) -> Readout:
        looks.append(frames)
        found = next(coming)
        if isinstance(found, vgps.VgpsError):
            raise found
        return found

    monkeypatch.setattr(ReadoutProbe, "_estimate", estimate)
    probe = ReadoutProbe(recording, vgps.Config())
    for frames in range(1, 500):
        if probe.stops(frames, lambda frames=frames: frames):
            break
    return looks, probe


def test_it_looks_until_the_motion_shows_the_shutter(monkeypatch, recording) -> None:
    looks, probe = looked_at(monkeypatch, recording, GeometryError("too early"), BLIND, ROLLS)
    assert looks == [60, 120, 240] and probe.found is ROLLS
    looks, probe = looked_at(monkeypatch, recording, BLIND, GLOBAL)
    assert looks == [60, 120] and probe.found is None


def test_a_rolling_shutter_that_leaves_no_path_is_forgotten(monkeypatch, recording) -> None:
    _, probe = looked_at(monkeypatch, recording, ROLLS)
    begun: list[float | None] = []

    class ThirdRunError(Exception):
        """It is not stopped any more."""

    def front_end(recording: Recording, *_: object) -> None:
        begun.append(recording.camera.readout_s)
        if len(begun) == 2:
            raise GeometryError("no map could be started")
        if len(begun) == 3:
            raise ThirdRunError

    monkeypatch.setattr(offline, "run_front_end", front_end)
    monkeypatch.setattr(offline, "readout_probe", lambda *_: probe)
    with pytest.raises(ThirdRunError):
        offline.smooth(recording, vgps.Config())
    assert begun == [None, ROLLS.readout_s, None]


def test_a_camera_that_has_not_moved_yet_is_looked_at_later(recording) -> None:
    front_end = run_front_end(replace(recording, gps=None), vgps.Config(), NoProgress())
    probe = ReadoutProbe(recording, vgps.Config())
    assert not probe.stops(60, lambda: replace(front_end, maps=())) and probe.found is None


def test_only_an_unknown_readout_is_looked_for(recording) -> None:
    config = vgps.Config()
    assert readout_probe(recording, config) is not None
    known = replace(recording, camera=replace(recording.camera, readout_s=0.0))
    assert readout_probe(known, config) is None
    for estimate in ("yes", "no"):
        settings = RollingShutterConfig.model_validate({"estimate": estimate})
        assert readout_probe(recording, vgps.Config(rolling_shutter=settings)) is None


def test_what_was_seen_is_where_stage_d_starts_from(recording) -> None:
    rolling, config = with_readout_seen(recording, vgps.Config(), 0.02)
    assert rolling.camera.readout_s == 0.02 and config.rolling_shutter.estimate == "yes"


def test_all_frames_confirm_it_or_not() -> None:
    drive, config = short_drive(), vgps.Config()
    for sigma_s, confirmed in ((1e-3, True), (1e-2, False)):
        solution = replace(
            drive,
            camera=replace(drive.camera, readout_s=0.02),
            sensors=replace(drive.sensors, camera_sigma={"readout_s": sigma_s}),
        )
        assert is_confirmed(solution, config) == confirmed
    assert not is_confirmed(drive, config)


@pytest.mark.slow
def test_two_seconds_of_a_shaken_camera_suffice(shaken: Path, tmp_path: Path) -> None:
    simulate(tmp_path / "steady", replace(SHAKEN, readout_s=0.0), seed=3)
    for folder, found in ((shaken, True), (tmp_path / "steady", False)):
        given = vgps.open_recording(folder)
        given = replace(given, camera=replace(given.camera, readout_s=None))
        probe = ReadoutProbe(given, vgps.Config())
        front_end = run_front_end(given, vgps.Config(), NoProgress(), probe=probe)
        assert len(front_end.t_s) == (60 if found else SHAKEN.frames)
        assert (probe.found is not None) == found
        if probe.found is not None:
            assert probe.found.readout_s == pytest.approx(0.03, abs=0.01)
