import numpy as np

from vgps.mapping.between_views import pose_between_views
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame
from vgps.mapping.zero_motion import ZeroMotion


def at(x):
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def test_standing_frames_without_a_pose_get_that_of_their_constraint_and_no_others():
    local_map, unknown = LocalMap(10, 5), np.full((4, 4), np.nan)
    poses = [at(1.0), unknown, unknown, at(5.0), at(6.0)]
    frames = tuple(NewFrame(float(k), pose) for k, pose in enumerate(poses))
    sigma = np.ones(6)
    held = (ZeroMotion(11, 10, at(0.25), sigma), ZeroMotion(14, 13, at(0.5), sigma))
    local_map.apply(MapUpdate(frames=frames, zero_motions=held))
    before = local_map.poses.copy()
    local_map.apply(pose_between_views(local_map))
    np.testing.assert_array_equal(local_map.poses[1], at(1.25))
    assert np.isnan(local_map.poses[2]).all()  # neither posed nor standing
    np.testing.assert_array_equal(local_map.poses[[0, 3, 4]], before[[0, 3, 4]])


def test_bridged_frames_without_a_pose_are_interpolated_between_posed_ones():
    local_map, unknown = LocalMap(10, 5), np.full((4, 4), np.nan)
    poses = [unknown, at(1.0), unknown, unknown, at(4.0)]
    frames = tuple(NewFrame(float(k), pose, k in (2, 3)) for k, pose in enumerate(poses))
    local_map.apply(MapUpdate(frames=frames))
    local_map.apply(pose_between_views(local_map))
    np.testing.assert_allclose(local_map.poses[1:, 0, 3], [1.0, 2.0, 3.0, 4.0])
    assert np.isnan(local_map.poses[0]).all()
