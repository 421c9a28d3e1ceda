from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import ANTENNA
from synthetic_map import away, context, map_of, moved, scene

from vgps.config import Config, WindowConfig
from vgps.geometry import rotation_vectors
from vgps.mapping.map_update import MapUpdate, Positions, Similarity
from vgps.smoothing.stage_c.window import contradicts, optimise_window

CONFIG = Config(window=WindowConfig(length_frames=20))


def optimised(local_map, fixes):
    """Poses of the map after its window was optimised; the map itself is checked to stay as it was."""
    before = local_map.poses.copy()
    result = optimise_window(local_map, fixes, ANTENNA, context(CONFIG))
    np.testing.assert_array_equal(local_map.poses, before)
    local_map.apply(result.update)
    assert result.converged
    return local_map.poses


def bend_deg(poses, true):
    """Largest error of a rotation (F,) since the first frame."""
    turned, truly = (rows[:, :3, :3].swapaxes(1, 2) @ rows[0, :3, :3] for rows in (poses, true))
    return float(np.degrees(np.linalg.norm(rotation_vectors(turned.swapaxes(1, 2) @ truly), axis=1).max()))


def spans(poses):
    """Distance (F,) from the first frame."""
    return np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1)


@pytest.mark.slow
def test_the_window_approaches_the_truth_and_older_frames_are_unchanged():
    problem, true, _, fixes = scene(disturbed=2.0)
    start = problem.world_T_camera.copy()
    start[:40] = true[:40]
    poses = optimised(map_of(replace(problem, world_T_camera=start), 0, 59), fixes)
    np.testing.assert_array_equal(poses[:40], true[:40])
    assert away(start[40:], true[40:]) > 0.2
    assert away(poses[40:], true[40:]) < 0.3 * away(start[40:], true[40:])


@pytest.mark.slow
def test_a_map_that_begins_in_the_window_is_held_by_its_fixes():
    problem, true, _, fixes = scene(frames=20, disturbed=2.0)
    made = map_of(problem, 0, 19)
    before = away(made.poses, true)
    assert away(optimised(made, fixes), true) < 0.6 * before


@pytest.mark.slow
@pytest.mark.parametrize("aligned, model", [(False, "cylinder"), (True, "none")])
def test_a_map_that_nothing_ties_to_the_world_keeps_its_scale(aligned, model):
    problem, true, _, fixes = scene(frames=20)
    made = map_of(problem, 0, 19, aligned=aligned)
    made.apply(MapUpdate(similarity=Similarity(3.0, np.eye(3), np.zeros(3))))
    length = spans(made.poses)[-1]
    made.apply(optimise_window(made, fixes, ANTENNA, context(CONFIG.with_gps(model=model))).update)
    assert spans(made.poses)[-1] == pytest.approx(length, rel=0.005) and away(made.poses, true) > 3.0


@pytest.mark.slow
def test_a_map_has_its_scale_from_before_a_stop_however_long():
    """The camera stood for two windows; all that it has seen since begins a tenth too large."""
    problem, true, _, fixes = scene()
    moved_truly = replace(problem, world_T_camera=true)
    made = map_of(moved_truly, 0, 59, history=20, aligned=False, stop=(49, 40))
    centre, end = true[49, :3, 3], made.points.shape[0]
    points = centre + 1.1 * (made.points - centre)
    moved(made, 90, lambda poses: enlarged(poses, centre))
    made.apply(MapUpdate(positions=Positions(np.arange(end), points, np.full(end, 0.5))))
    made.apply(optimise_window(made, fixes, ANTENNA, context(CONFIG), tolerance=20.0).update)
    after = np.linalg.norm(made.poses[90:, :3, 3] - centre, axis=1)
    np.testing.assert_allclose(after, np.linalg.norm(true[50:, :3, 3] - centre, axis=1), rtol=0.02)
    np.testing.assert_allclose(made.poses[50:90], np.broadcast_to(made.poses[49], (40, 4, 4)), atol=1e-9)


def enlarged(poses, centre):
    """Poses (n, 4, 4) a tenth farther from a point."""
    out = poses.copy()
    out[:, :3, 3] = centre + 1.1 * (poses[:, :3, 3] - centre)
    return out


@pytest.mark.slow
def test_no_second_view_bends_an_unaligned_map():
    """All poses begin wrong by a degree; with two of them held, 0.3 were left."""
    problem, true, _, fixes = scene(frames=20, disturbed=2.0)
    made = map_of(problem, 0, 19, aligned=False)
    start = made.poses.copy()
    made.apply(optimise_window(made, fixes, ANTENNA, context(CONFIG), tolerance=20.0).update)
    assert bend_deg(start, true) > 1.0 and bend_deg(made.poses, true) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    "aligned, model, stated", [(False, "cylinder", True), (True, "none", True), (True, "cylinder", False)]
)
def test_the_bending_is_stated_where_no_fixes_straighten_the_path(aligned, model, stated):
    problem, _, _, fixes = scene(frames=20)
    made = map_of(problem, 0, 19, aligned=aligned)
    made.apply(optimise_window(made, fixes, ANTENNA, context(CONFIG.with_gps(model=model))).update)
    assert np.isfinite(made.bending[10:]).all() == stated == bool(np.nansum(made.bending) > 0.0)


def test_fixes_contradict_a_map_only_beyond_region_and_tolerance():
    problem, true, _, fixes = scene()
    made = map_of(replace(problem, world_T_camera=true), 0, 59)
    alternately = (-1.0) ** np.arange(len(fixes))

    def asked(moved_m, used=True):
        moved = fixes.world_p_fix + np.outer(alternately * moved_m, [1.0, 0.0, 0.0])
        row = np.full(len(fixes), used)
        return contradicts(made, replace(fixes, world_p_fix=moved, used=row), ANTENNA, CONFIG)

    assert not asked(0.0) and not asked(0.2)
    assert asked(1.0) and not asked(1.0, used=False)


@pytest.mark.parametrize("axis", [0, 2])
def test_an_offset_common_to_all_fixes_contradicts_a_map_even_within_the_tolerance(axis):
    problem, true, _, fixes = scene()
    made = map_of(replace(problem, world_T_camera=true), 0, 59)

    def asked(moved_m, used):
        moved = fixes.world_p_fix + moved_m * np.eye(3)[axis]
        believed = replace(fixes, world_p_fix=moved, used=np.arange(len(fixes)) >= len(fixes) - used)
        return contradicts(made, believed, ANTENNA, CONFIG)

    assert not asked(0.08, used=5)
    assert asked(0.2, used=5)
    assert not asked(0.2, used=2)
