"""Cameras that are turned about their axis of view, though nobody said so."""

from dataclasses import replace

import numpy as np
import pytest
from brief_videos import first_frames, thinned
from fewer_features import fewer_features

import vgps
from scripts.experiments.turned_cameras import turned
from vgps.config import Config, StartConfig
from vgps.errors import GeometryError
from vgps.evaluation import evaluate
from vgps.gps.clock_search import ClockCheck
from vgps.mapping.trajectory import map_trajectory
from vgps.pipeline import turned_camera
from vgps.pipeline.front_end import run_front_end
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import NoProgress
from vgps.smoothing.alignment.similarity import is_far_less
from vgps.solution import Trajectory

pytestmark = pytest.mark.slow
OVER = np.diag([-1.0, -1.0, 1.0])


def test_a_camera_upside_down_is_found_and_posed_upside_down(data_dir):
    recording = first_frames(vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea"), 110)
    solution = vgps.smooth(turned(thinned(recording, 2), 2), fewer_features(150))
    truth = read_trajectory(data_dir / "kitti07/truth.tum")
    assert evaluate(solution, truth).camera_position_m.mean < 0.05
    assert np.median(solution.world_T_camera[:, 2, 1]) > 0.9  # its down points up
    assert any("the camera is turned by 180 degrees" in warning for warning in solution.warnings)
    assert not any("rotations are wrong" in warning for warning in solution.warnings)
    assert solution.config["start"]["roll_deg"] == 0.0  # the settings are the user's


@pytest.fixture(scope="module")
def front_end(brief):
    """That of a short walk."""
    return run_front_end(vgps.open_recording(brief), Config(), NoProgress())


@pytest.mark.parametrize(
    ("assumed_deg", "turned_deg", "again_deg", "measured", "values", "kept_deg"),
    [
        (0.0, 180.0, 0.0, "unexplained", (0.3, 0.29), 180.0),
        (90.0, 180.0, 0.0, "unexplained", (0.3, 0.01), 270.0),
        (0.0, 180.0, 0.0, "unexplained", (0.01, 0.3), 0.0),  # no better
        (0.0, 90.0, 0.0, "misaligned", (50.0, 18.0), 90.0),
        (0.0, 90.0, 0.0, "misaligned", (20.0, 18.0), 0.0),  # hardly better
        (0.0, 90.0, 180.0, "misaligned", (50.0, 18.0), 0.0),  # a contradiction
        (0.0, 0.0, 0.0, "misaligned", (), 0.0),
    ],
)
def test_a_turn_counts_if_the_run_that_begins_with_it_explains_the_fixes(
    monkeypatch, front_end, assumed_deg, turned_deg, again_deg, measured, values, kept_deg
):
    runs, left = [], dict(zip((False, True), values, strict=False))  # before it, and again
    compared = ClockCheck(None, turned_deg=again_deg)
    clock = ClockCheck(None, turned_deg=turned_deg, mirrored=measured == "unexplained")
    first = replace(front_end, clock=clock)

    def run(recording, config, _):
        runs.append(config.start.roll_deg)
        return replace(front_end, recording=recording)

    monkeypatch.setattr(turned_camera, "run_front_end", run)
    monkeypatch.setattr(turned_camera, "with_gps_clock", lambda one, _: replace(one, clock=compared))
    monkeypatch.setattr(turned_camera, measured, lambda one, _: left[one is not first])
    config = Config(start=StartConfig(roll_deg=assumed_deg))
    found, settings = turned_camera.with_right_roll(first, config, NoProgress())
    assert settings.start.roll_deg == kept_deg and (found is first) == (kept_deg == assumed_deg)
    assert len(runs) == (turned_deg != 0.0)
    told = [note for note in found.recording.notes if f"turned by {kept_deg:g} degrees" in note]
    assert len(told) == (kept_deg != assumed_deg)
    assert all(("mirrored picture" in note) == (turned_deg == 180.0) for note in told)


def test_a_path_that_has_turned_over_by_itself_begins_again_without_more_evidence(monkeypatch, front_end):
    path = map_trajectory(front_end.maps[0])
    poses = path.world_T_camera.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ OVER
    clock = ClockCheck(None, video=Trajectory(path.t_s, poses), turned_deg=180.0)
    monkeypatch.delattr(turned_camera, "misaligned")
    monkeypatch.setattr(turned_camera, "run_front_end", lambda *_: front_end)
    monkeypatch.setattr(turned_camera, "with_gps_clock", lambda one, _: replace(one, clock=ClockCheck(None)))
    found, settings = turned_camera.with_right_roll(replace(front_end, clock=clock), Config(), NoProgress())
    assert settings.start.roll_deg == 180.0 and found.clock == ClockCheck(None)


def test_a_path_that_is_bent_lies_badly_along_the_fixes(front_end):
    path = map_trajectory(front_end.maps[0])
    bent = path.world_T_camera.copy()
    bent[len(bent) // 2 :, 1, 3] += 2.0

    def cost(poses):
        clock = ClockCheck(None, video=Trajectory(path.t_s, poses))
        return turned_camera.misaligned(replace(front_end, clock=clock), Config())

    assert is_far_less(cost(path.world_T_camera), cost(bent))
    assert turned_camera.misaligned(replace(front_end, clock=None), Config()) == np.inf


def test_a_turn_that_leaves_no_path_is_dropped(monkeypatch, front_end):
    def run(*_):
        raise GeometryError("no frame has a pose")

    monkeypatch.setattr(turned_camera, "run_front_end", run)
    first = replace(front_end, clock=ClockCheck(None, turned_deg=180.0))
    assert turned_camera.with_right_roll(first, Config(), NoProgress()) == (first, Config())
