"""What a saved recording holds, read back from the file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reading_back import Logged

from vgps.errors import RunFolderError
from vgps.solution import Landmarks, Observations, Solution
from vgps.viewer import inspect_run
from vgps.viewer.rerun_recording import screenshot_time_s

FIXES = "/world/fixes"


def test_everything_has_its_entity(logged: Logged) -> None:
    assert logged.entities >= {
        "/world/camera",
        "/world/camera/image",
        "/world/camera/image/features",
        "/world/camera/image/reprojections",
        "/world/camera/image/residuals_x10",
        "/world/path",
        "/world/path_before_d",
        "/world/landmarks",
        "/world/chase",
        "/world/fix_now",
        f"{FIXES}/rtk_fix/used/region",
        f"{FIXES}/rtk_float/used/region",
        f"{FIXES}/rtk_fix/down_classed/region",
        f"{FIXES}/rtk_fix/rejected/region",
        f"{FIXES}/unknown/not_used",
        "/map/path",
        "/map/fixes/rtk_fix/rejected",
        "/graph",
        "/verdicts",
        "/summary",
    }
    assert f"{FIXES}/unknown/not_used/region" not in logged.entities  # it was given no region


def test_frames_are_on_both_timelines(logged: Logged, solution: Solution) -> None:
    for entity in ("/world/camera", "/world/camera/image/features", "/plots/features/seen", "/map/camera"):
        assert logged.timelines(entity) >= {"time", "frame"}
        assert logged.times_s(entity) == pytest.approx(solution.t_s.tolist())
    assert logged.times_s("/verdicts") == pytest.approx([0.03, 0.13, 0.23, 0.33, 0.43])


def test_fixes_are_shown_at_their_time_stamps_less_the_time_offset(
    logged: Logged, late: Solution, tmp_path: Path
) -> None:
    inspect_run(late, save=tmp_path / "late.rrd")
    shifted = Logged(tmp_path / "late.rrd")
    for entity in ("/verdicts", "/world/fix_now", "/plots/residual_over_region/r", "/plots/energy/gps"):
        assert logged.times_s(entity)
        assert shifted.times_s(entity) == pytest.approx(logged.times_s(entity))
    assert screenshot_time_s(late) == pytest.approx(0.33)


def test_a_run_without_gps_and_without_an_older_path(solution: Solution, tmp_path: Path) -> None:
    bare = replace(
        solution, gps=None, fixes=None, georeferenced=False, world_origin=None, world_p_before=None
    )
    inspect_run(bare, save=tmp_path / "bare.rrd")
    entities = Logged(tmp_path / "bare.rrd").entities
    assert {"/world/path", "/graph", "/summary"} <= entities
    strangers = ("/world/fix", "/map", "/verdicts", "/world/path_before_d", "/plots/residual")
    assert not [entity for entity in entities if entity.startswith(strangers)]


def test_a_run_without_landmarks(solution: Solution, tmp_path: Path) -> None:
    none = np.zeros(0, np.int64)
    empty = replace(
        solution,
        landmarks=Landmarks(np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.uint8)),
        observations=Observations(none, none, np.zeros((0, 2))),
    )
    inspect_run(empty, save=tmp_path / "empty.rrd")
    (nodes,) = Logged(tmp_path / "empty.rrd").rows("/graph", "GraphNodes:node_ids")
    assert not [node for node in nodes if node.startswith("l")]


def test_a_file_that_cannot_be_written_is_an_error(solution: Solution, tmp_path: Path) -> None:
    folder = tmp_path / "run.rrd"
    folder.mkdir()
    with pytest.raises(RunFolderError, match="is a folder"):
        inspect_run(solution, save=folder)


def test_the_screenshot_is_of_the_first_rejected_fix(solution: Solution) -> None:
    assert screenshot_time_s(solution) == 0.33
    assert screenshot_time_s(replace(solution, gps=None, fixes=None)) == pytest.approx(0.25)
