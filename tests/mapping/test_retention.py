import numpy as np
from synthetic_map import map_of, scene

from vgps.config import Config, MappingConfig, OnlineConfig, WindowConfig
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, NewFrame, NewView
from vgps.mapping.retention import RetentionPolicy, retire_before, retire_map


def walk(frames=40, first=100):
    """Ten frames a second from frame 100 on, frame k at x = k; frames 103 and 120 are bridged."""
    local_map, nothing = LocalMap(first, 5), np.zeros((0, 2))
    for k in range(first, first + frames):
        pose = np.eye(4)
        pose[0, 3] = k
        view = NewView(k, nothing, nothing, np.zeros(0, dtype=bool))
        local_map.apply(MapUpdate(frames=(NewFrame(0.1 * k, pose, k in (103, 120)),), view=view))
    return local_map


def test_the_policy_keeps_a_window_its_period_and_the_longest_track():
    config = Config(
        window=WindowConfig(length_frames=50, every_frames=12),
        mapping=MappingConfig(max_track_frames=30),
        online=OnlineConfig(keep_s=40.0),
    )
    assert RetentionPolicy.of(config) == RetentionPolicy(view_frames=92, path_s=40.0)


def test_poses_before_the_horizon_are_retired():
    local_map = walk()
    retired = retire_before(local_map, 11.0, RetentionPolicy(view_frames=15, path_s=0.0))
    assert retired.first_frame == 100 and retired.bridged == {103, 120} and not retired.aligned
    assert retired.poses[:, 0, 3].tolist() == list(range(100, 110))
    assert local_map.first_frame == 110 and local_map.poses[0, 0, 3] == 110.0
    assert local_map.bridged == {120}


def test_frames_with_observations_keep_their_poses_though_the_horizon_is_later():
    local_map = walk()
    retired = retire_before(local_map, 99.0, RetentionPolicy(view_frames=15, path_s=0.0))
    assert len(retired.poses) == 25 and local_map.first_frame == 125


def test_what_was_seen_before_a_stop_is_kept_as_long_as_the_path():
    """The camera stands in frames 41 to 70 of 90; six of the last 25 that move lie before."""
    problem, _, _, _ = scene()
    local_map, policy = map_of(problem, 0, 59, stop=(40, 30)), RetentionPolicy(view_frames=25, path_s=0.0)
    retire_before(local_map, 0.0, policy)
    assert local_map.observations().frame.min() == 35 and local_map.first_frame == 0
    retire_before(local_map, 5.0, policy)
    assert local_map.observations().frame.min() == 71 and local_map.first_frame == 50


def test_before_the_first_frame_there_is_nothing_to_retire():
    local_map = walk()
    retired = retire_before(local_map, 5.0, RetentionPolicy(view_frames=15, path_s=0.0))
    assert len(retired.poses) == 0 and local_map.first_frame == 100


def test_a_finished_map_is_retired_whole():
    local_map = walk()
    local_map.apply(MapUpdate(aligned=True))
    retired = retire_map(local_map)
    assert retired.aligned and retired.first_frame == 100 and retired.bridged == {103, 120}
    np.testing.assert_array_equal(retired.poses, local_map.poses)
