from dataclasses import replace

import numpy as np
from synthetic_map import map_of, moved, scene

from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame
from vgps.mapping.trajectory import map_trajectory, odometry_trajectory


def test_the_odometry_is_unchanged_by_late_fixes():
    problem, true, t_s, _ = scene(disturbed=0.0)
    local_map = map_of(replace(problem, world_T_camera=true), 0, 39)

    def two_frames_late(poses):
        poses[:, :3, 3] = true[18:38, :3, 3]
        return poses

    moved(local_map, 20, two_frames_late)
    path = odometry_trajectory(local_map, float(t_s[15]))
    np.testing.assert_array_equal(path.t_s, t_s[15:40])
    steps = np.diff(path.world_T_camera[:, :3, 3], axis=0)
    np.testing.assert_allclose(steps, np.diff(true[15:40, :3, 3], axis=0), atol=0.02)


def test_without_odometry_a_step_is_that_of_the_poses():
    local_map = LocalMap(3, 5)
    east = np.tile(np.eye(4), (4, 1, 1))
    east[:, 0, 3] = 0.0, 1.0, 3.0, 6.0
    frames = [np.full((4, 4), np.nan), *east]
    local_map.apply(MapUpdate(frames=tuple(NewFrame(0.1 * k, pose) for k, pose in enumerate(frames))))
    # the step into the first posed frame is unknown, the one after it was tracked
    local_map.apply(MapUpdate(first_frame=3, poses=np.concatenate([east[:1], local_map.poses[1:]])))
    path = odometry_trajectory(local_map)
    np.testing.assert_allclose(path.world_T_camera[:, 0, 3], [0.0, 0.0, 1.0, 3.0, 6.0])
    np.testing.assert_allclose(path.t_s, [0.0, 0.1, 0.2, 0.3, 0.4])


def test_a_path_begins_at_the_first_posed_frame_or_later():
    local_map = LocalMap(0, 5)
    poses = [np.full((4, 4), np.nan), np.eye(4), np.eye(4), np.eye(4)]
    local_map.apply(MapUpdate(frames=tuple(NewFrame(float(k), pose) for k, pose in enumerate(poses))))
    assert map_trajectory(local_map).t_s.tolist() == [1.0, 2.0, 3.0]
    assert map_trajectory(local_map, 1.5).t_s.tolist() == [2.0, 3.0]
