"""A path in several maps: fixes align them as one, move those that continue others, and are judged by map."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from synthetic_bundle import ANTENNA
from synthetic_map import away, map_of, scene

from vgps.config import Config
from vgps.gps.outlier_detection import detect_outliers
from vgps.mapping.map_update import MapUpdate, Similarity
from vgps.smoothing.merging.torn_path import align_torn_path, assess_parts, mend_torn_path, untorn_path
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations, Trajectory

CONFIG = Config()
TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def torn(*ends):
    """Maps of a drive that end at these frames, the true path and the fixes."""
    problem, true, t_s, fixes = scene(disturbed=0.0)
    maps = [
        map_of(problem, begin, end) for begin, end in zip((0, *np.add(ends, 1)), (*ends, 59), strict=True)
    ]
    return maps, true, t_s, fixes


def path_of(maps, t_s):
    return Trajectory(t_s, np.concatenate([one.poses for one in maps]))


def move(local_map, scale, turn, shift):
    """Apply a similarity about the first camera of a map."""
    first = local_map.poses[0, :3, 3]
    by = Similarity(scale, turn, first - scale * turn @ first + np.array(shift))
    local_map.apply(MapUpdate(similarity=by))


def aligned(maps, t_s, fixes):
    return align_torn_path(maps, path_of(maps, t_s), fixes, ANTENNA, CONFIG)


def test_fixes_of_which_no_map_has_two_align_them_as_a_whole():
    maps, true, t_s, fixes = torn(11, 23, 35, 47)
    one_each = fixes.where(np.isin(np.arange(len(fixes)), [1, 4, 7, 10, 13]))
    for local_map in maps:
        local_map.apply(MapUpdate(similarity=Similarity(0.2, TURN, np.array([5.0, 5.0, 5.0]))))
    assert away(path_of(maps, t_s).world_T_camera, true) > 3.0
    assert aligned(maps, t_s, one_each)
    assert away(path_of(maps, t_s).world_T_camera, true) < 0.3


def test_one_fix_aligns_no_map_nor_do_several_far_from_all():
    maps, _, t_s, fixes = torn(11)
    assert not aligned(maps, t_s, fixes.where(np.arange(len(fixes)) == 3))
    path = path_of(maps, t_s)
    for since_s, near in ((1.1, True), (1.1 + 1.5, False)):
        later = fixes.where(fixes.t_s > since_s)
        assert align_torn_path(maps[:1], path, later.where(np.arange(2)), ANTENNA, CONFIG) == near


def test_fixes_move_maps_that_continue_each_other():
    """Each is turned and scaled against the one before it: in the end by 15 degrees, 1.6 times as long."""
    maps, true, t_s, fixes = torn(9, 19, 29, 39, 49)
    for k, local_map in enumerate(maps[1:], 1):
        step = true[10 * k, :3, 3] - true[10 * k - 1, :3, 3]
        turn = Rotation.from_euler("z", 3.0 * k, degrees=True).as_matrix()
        at = maps[k - 1].poses[-1, :3, 3] + 1.1**k * turn @ step
        move(local_map, 1.1**k, turn, at - local_map.poses[0, :3, 3])
    before = away(path_of(maps, t_s).world_T_camera, true)
    first = maps[0].poses.copy()
    mend_torn_path(maps, maps[1:], path_of(maps, t_s), fixes, ANTENNA, CONFIG)
    assert before > 3.0 and away(path_of(maps, t_s).world_T_camera, true) < 0.5
    assert np.array_equal(maps[0].poses, first)


def test_fixes_are_judged_by_the_map_they_are_in():
    """A step between two maps is no error of the fixes on one side."""
    maps, _, t_s, fixes = torn(29)
    move(maps[1], 1.0, np.eye(3), (6.0, 0.0, 4.0))
    path = path_of(maps, t_s)
    bad = 3
    world_p_fix = fixes.world_p_fix.copy()
    world_p_fix[bad] += (0.0, 30.0, 0.0)
    fixes = replace(fixes, world_p_fix=world_p_fix)
    rejected = detect_outliers(path, fixes, ANTENNA, CONFIG).rejected
    assert rejected.sum() > 1
    by_piece = assess_parts(maps, [], path, fixes, ANTENNA, CONFIG)
    assert np.flatnonzero(by_piece.rejected).tolist() == [bad]
    inside = (fixes.t_s <= t_s[29]) | (fixes.t_s >= t_s[30])
    np.testing.assert_array_equal(np.isfinite(by_piece.nominal), inside)


@pytest.mark.parametrize(
    ("seams", "expected"), [([], (0, 60)), ([20], (20, 60)), ([10, 35], (10, 35)), ([40, 50], (0, 40))]
)
def test_the_longest_part_that_tracks_join(seams, expected):
    _, true, t_s, fixes = torn(29)
    frame = np.arange(60)
    landmark = np.searchsorted(seams, frame, side="right")
    whole = Scene(t_s, true, np.zeros((3, 3)), Observations(frame, landmark, np.zeros((60, 2))))
    found = untorn_path(Trajectory(t_s, true), whole, fixes, 1)
    np.testing.assert_array_equal(found.t_s, t_s[slice(*expected)])
    few = untorn_path(Trajectory(t_s[::3], true[::3]), whole, fixes, 1)
    np.testing.assert_array_equal(few.t_s, t_s[::3][(t_s[::3] >= found.t_s[0]) & (t_s[::3] <= found.t_s[-1])])
