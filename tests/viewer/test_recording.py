"""What a saved recording holds, read back from the file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reading_back import Logged

from vgps.camera import distort
from vgps.errors import RunFolderError
from vgps.solution import Landmarks, Observations, Solution
from vgps.viewer import colours, inspect_run
from vgps.viewer.recording import shown_time_s

FIXES = "/world/fixes"


@pytest.fixture
def logged(solution: Solution, tmp_path: Path) -> Logged:
    assert inspect_run(solution, save=tmp_path / "run.rrd") == ()
    return Logged(tmp_path / "run.rrd")


def packed(colour: tuple[int, ...]) -> int:
    red, green, blue, alpha = colour
    return red << 24 | green << 16 | blue << 8 | alpha


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


@pytest.mark.parametrize(
    ("group", "radius", "height", "colour"),
    [
        ("rtk_fix/used", 0.1, 0.1, colours.CLASS["rtk_fix"]),
        ("rtk_float/used", 2.4, 12.0, colours.CLASS["rtk_float"]),
        ("rtk_fix/down_classed", 2.4, 12.0, colours.DOWN_CLASSED),
        ("rtk_fix/rejected", 0.1, 0.1, colours.REJECTED),
    ],
)
def test_cylinders_have_their_true_size_and_the_colour_of_their_verdict(
    logged: Logged, group: str, radius: float, height: float, colour: tuple[int, ...]
) -> None:
    (radii,) = logged.rows(f"{FIXES}/{group}/region", "Cylinders3D:radii")
    (lengths,) = logged.rows(f"{FIXES}/{group}/region", "Cylinders3D:lengths")
    assert radii == pytest.approx([radius])
    assert lengths == pytest.approx([height])  # twice h, which is half the height
    (tint,) = logged.rows(f"{FIXES}/{group}/region", "Cylinders3D:colors")[0]
    assert tint >> 8 == packed(colour) >> 8
    assert logged.rows(f"{FIXES}/{group}", "Points3D:colors") == [[packed(colour)]]


def test_a_fix_says_what_was_made_of_it(logged: Logged) -> None:
    (labels,) = logged.rows(f"{FIXES}/rtk_fix/rejected", "Points3D:labels")
    assert labels == ["fix 3 (line 12) at 0.33 s: rtk_fix, rejected"]
    texts = [text for (text,) in logged.rows("/verdicts", "TextLog:text")]
    assert len(texts) == 5
    assert texts[3] == "fix 3, rtk_fix: rejected: because 3"
    assert [level for (level,) in logged.rows("/verdicts", "TextLog:level")] == [
        "INFO",
        "INFO",
        "WARN",
        "ERROR",
        "DEBUG",
    ]


def test_a_residual_runs_from_the_fix_to_the_antenna(logged: Logged) -> None:
    ((strip,),) = logged.rows(f"{FIXES}/rtk_float/used/residual", "LineStrips3D:strips")
    np.testing.assert_allclose(strip, [[1.0, 1.3, 0.0], [-0.2, 1.3, 3.0]], rtol=1e-6)


def test_frames_are_on_both_timelines(logged: Logged, solution: Solution) -> None:
    for entity in ("/world/camera", "/world/camera/image/features", "/plots/features/seen", "/map/camera"):
        assert logged.timelines(entity) >= {"time", "frame"}
        assert logged.times_s(entity) == pytest.approx(solution.t_s.tolist())
    assert logged.times_s("/verdicts") == pytest.approx([0.03, 0.13, 0.23, 0.33, 0.43])


def test_fixes_are_shown_when_they_were_not_when_a_late_clock_stamped_them(
    logged: Logged, late: Solution, tmp_path: Path
) -> None:
    inspect_run(late, save=tmp_path / "late.rrd")
    shifted = Logged(tmp_path / "late.rrd")
    for entity in ("/verdicts", "/world/fix_now", "/plots/residual_over_region/r", "/plots/energy/gps"):
        assert logged.times_s(entity)
        assert shifted.times_s(entity) == pytest.approx(logged.times_s(entity))
    assert shown_time_s(late) == pytest.approx(0.33)


def test_the_camera_moves_along_its_path(logged: Logged, solution: Solution) -> None:
    centres = [row[0] for row in logged.rows("/world/camera", "Transform3D:translation")]
    np.testing.assert_allclose(centres, solution.world_T_camera[:, :3, 3])
    (before,) = logged.rows("/world/path_before_d", "LineStrips3D:strips")[0]
    np.testing.assert_allclose(before, solution.world_p_before)
    strips = logged.rows("/world/path", "LineStrips3D:strips")[0]
    tints = logged.rows("/world/path", "LineStrips3D:colors")[0]
    assert [len(strip) for strip in strips] == [4, 2, 2]  # tracked, bridged, tracked; the pieces touch
    assert tints == [packed(c) for c in (colours.PATH, colours.BRIDGED, colours.PATH)]


def test_features_are_where_the_video_shows_them_and_coloured_by_their_error(
    logged: Logged, solution: Solution
) -> None:
    frames = logged.rows("/world/camera/image/features", "Points2D:positions")
    assert [len(points) for points in frames] == [3] * 6
    seen = solution.observations
    shown = distort(solution.camera, seen.uv_px[seen.frame == 0])
    np.testing.assert_allclose(sorted(frames[0]), sorted(shown.tolist()), rtol=1e-5)
    tints = [row for row in logged.rows("/world/camera/image/features", "Points2D:colors") if len(row) == 3]
    assert sum(tint >> 8 == 0xFADC28 for tint in tints[0]) == 1  # one pixel of error: yellow
    assert all(tint >> 8 == 0x3CDC5A for tint in tints[1])


def test_plots_hold_the_numbers(logged: Logged) -> None:
    (largest,) = logged.rows("/plots/reprojection_px/largest", "Scalars:scalars")[0]
    assert largest == pytest.approx(1.0)
    sigma = [row[0] for row in logged.rows("/plots/sigma_m/up", "Scalars:scalars")]
    assert sigma == [0.125] * 6
    degrees = [row[0] for row in logged.rows("/plots/sigma_deg/east", "Scalars:scalars")]
    assert degrees == pytest.approx([0.25] * 6)
    assert logged.rows("/plots/residual_over_region/rejected", "Scalars:scalars") == [[3.0]]  # of 300


def test_the_map_begins_at_the_origin_and_goes_north(logged: Logged) -> None:
    (path,) = logged.rows("/map/path", "GeoLineStrings:line_strings")[0]
    assert path[0] == pytest.approx([49.0, 8.0], abs=1e-9)
    assert path[-1][0] == pytest.approx(49.0 + 5 / 111_220, abs=1e-7)  # metres in a degree at 49 N


def test_a_run_without_gps_and_without_an_older_path(solution: Solution, tmp_path: Path) -> None:
    bare = replace(
        solution, gps=None, fixes=None, georeferenced=False, world_origin=None, world_p_before=None
    )
    inspect_run(bare, save=tmp_path / "bare.rrd")
    entities = Logged(tmp_path / "bare.rrd").entities
    assert {"/world/path", "/graph", "/summary"} <= entities
    strangers = ("/world/fix", "/map", "/verdicts", "/world/path_before_d", "/plots/residual")
    assert not [entity for entity in entities if entity.startswith(strangers)]


def test_a_run_that_sees_nothing(solution: Solution, tmp_path: Path) -> None:
    none = np.zeros(0, np.int64)
    blind = replace(
        solution,
        landmarks=Landmarks(np.zeros((0, 3)), np.zeros(0), np.zeros(0, np.uint8)),
        observations=Observations(none, none, np.zeros((0, 2))),
    )
    inspect_run(blind, save=tmp_path / "blind.rrd")
    (nodes,) = Logged(tmp_path / "blind.rrd").rows("/graph", "GraphNodes:node_ids")
    assert not [node for node in nodes if node.startswith("l")]


def test_the_summary_says_what_to_know(logged: Logged) -> None:
    ((text,),) = logged.rows("/summary", "TextDocument:text")
    for words in (
        "6 frames, 3 landmarks, 18 observations",
        "2 used, 1 down-classed, 1 rejected, 1 not used",
        "| video | 10 | 2 |",
        "- the roll is uncertain",
    ):
        assert words in text


def test_a_file_that_cannot_be_written_is_told(solution: Solution, tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="is a folder"):
        inspect_run(solution, save=tmp_path)


def test_the_picture_is_of_the_first_rejected_fix(solution: Solution) -> None:
    assert shown_time_s(solution) == 0.33
    assert shown_time_s(replace(solution, gps=None, fixes=None)) == pytest.approx(0.25)
