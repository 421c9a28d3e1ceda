"""The scene, read back from a saved recording."""

from dataclasses import replace

import numpy as np
import pytest
from reading_back import Logged, packed

from vgps.model import FixClass
from vgps.solution import Solution, Verdict
from vgps.viewer import colours
from vgps.viewer.scene import extent_m, fix_groups

FIXES = "/world/fixes"


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


@pytest.mark.slow
def test_the_label_of_a_fix_states_its_class_and_verdict(logged: Logged) -> None:
    (labels,) = logged.rows(f"{FIXES}/rtk_fix/rejected", "Points3D:labels")
    assert labels == ["fix 3 (line 12) at 0.33 s: rtk_fix, rejected"]


def test_a_residual_runs_from_the_fix_to_the_antenna(logged: Logged) -> None:
    ((strip,),) = logged.rows(f"{FIXES}/rtk_float/used/residual", "LineStrips3D:strips")
    np.testing.assert_allclose(strip, [[1.0, 1.3, 0.0], [-0.2, 1.3, 3.0]], rtol=1e-6)


def test_camera_and_paths_are_where_the_run_has_them(logged: Logged, solution: Solution) -> None:
    centres = [row[0] for row in logged.rows("/world/camera", "Transform3D:translation")]
    np.testing.assert_allclose(centres, solution.world_T_camera[:, :3, 3])
    (before,) = logged.rows("/world/path_before_d", "LineStrips3D:strips")[0]
    np.testing.assert_allclose(before, solution.world_p_before)
    strips = logged.rows("/world/path", "LineStrips3D:strips")[0]
    tints = logged.rows("/world/path", "LineStrips3D:colors")[0]
    assert [len(strip) for strip in strips] == [4, 2, 2]  # tracked, bridged, tracked; the pieces touch
    assert tints == [packed(c) for c in (colours.PATH, colours.BRIDGED, colours.PATH)]


def test_fixes_without_a_position_are_in_no_group(solution: Solution) -> None:
    groups = [(fix_class, verdict, rows.tolist()) for fix_class, verdict, rows in fix_groups(solution)]
    assert groups[:2] == [
        (FixClass.RTK_FIX, Verdict.USED, [0]),
        (FixClass.RTK_FIX, Verdict.DOWN_CLASSED, [2]),
    ]
    assert sorted(row for *_, rows in groups for row in rows) == [0, 1, 2, 3, 4]
    world_p_fix = solution.fixes.world_p_fix.copy()
    world_p_fix[4] = np.nan
    fewer = replace(solution, fixes=replace(solution.fixes, world_p_fix=world_p_fix))
    assert sorted(row for *_, rows in fix_groups(fewer) for row in rows) == [0, 1, 2, 3]


def test_the_extent_is_the_longest_side_of_the_path(solution: Solution) -> None:
    assert extent_m(solution) == 5.0
    standing = replace(solution, world_T_camera=solution.world_T_camera[:1])
    assert extent_m(standing) == 1.0
