import numpy as np
import pytest
from fused_drives import DrivingCamera
from textured_room import followed_map, path

from vgps.geometry import interpolate_poses
from vgps.mapping.map_update import MapUpdate, Similarity
from vgps.mapping.zero_motion import ZeroMotion
from vgps.online.fusion.place_ties import PlaceTies
from vgps.online.fusion.video_path import path_of

PATH = DrivingCamera(40).seen(np.random.default_rng(0))


@pytest.mark.parametrize("t_s", [[], [3.9], [0.0], [-1.0], [9.0], [1.23, 1.27], [2.0, 0.31, 5.0]])
def test_poses_are_those_of_the_whole_path(t_s):
    found = PATH.at(np.array(t_s, float))
    np.testing.assert_allclose(
        found, interpolate_poses(PATH.t_s, PATH.poses, np.array(t_s, float)), atol=1e-12
    )


def test_a_path_since_a_time_begins_there():
    later = PATH.since(1.25)
    assert later.t_s[0] == 1.25 and later.t_s[1] == pytest.approx(1.3) and not later.moving[0]
    np.testing.assert_allclose(later.at(np.array([1.25, 2.0])), PATH.at(np.array([1.25, 2.0])), atol=1e-12)


def test_a_path_bends_as_stage_c_says_but_not_while_the_camera_stands():
    local_map, _ = followed_map(path(20))
    standing = ZeroMotion(15, 14, np.eye(4), np.ones(6))
    bending = np.where(np.arange(20) < 12, 0.25, np.nan)
    local_map.apply(MapUpdate(poses=local_map.poses.copy(), bending=bending, zero_motions=(standing,)))
    found = path_of(local_map, 100.0, PlaceTies.none())
    np.testing.assert_array_equal(found.bending, np.where(np.arange(20) == 15, 0.0, 0.25))


def test_the_path_of_a_map_has_the_last_seconds_and_the_ties_in_them():
    local_map, _ = followed_map(path(20))
    times_s = np.array([0.3, 0.9, 1.5])
    ties = PlaceTies(t_s=times_s, world_T_camera=np.tile(np.eye(4), (3, 1, 1)), sigma=np.ones((3, 6)))
    found = path_of(local_map, 1.0, ties)
    np.testing.assert_allclose(found.t_s[[0, -1]], [0.9, 1.9])
    np.testing.assert_array_equal(found.ties.t_s, times_s[1:])
    kept = found.snapshot()
    local_map.apply(MapUpdate(similarity=Similarity(2.0, np.eye(3), np.ones(3))))
    assert not np.allclose(found.poses, kept.poses)
    np.testing.assert_array_equal(kept.poses, path(20)[9:])
