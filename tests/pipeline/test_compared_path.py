"""Paths that are compared with fixes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.mapping.map_update import Similarity
from vgps.pipeline.compared_path import seen_part, through_few
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations, Trajectory

T_S = 0.125 * np.arange(41)


@pytest.fixture(scope="module")
def path():
    """Five seconds that end in a turn and begin at a stand, so that the camera hardly moves for a while."""
    poses = np.tile(np.eye(4), (len(T_S), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.outer(0.2 * T_S, [0.1, 1.0, 0.0])).as_matrix()
    poses[:, 0, 3] = np.maximum(T_S - 2.0, 0.0) ** 2
    poses[:, 1, 3] = np.sin(np.maximum(T_S - 3.0, 0.0))
    return Trajectory(T_S, poses)


def test_few_frames_may_have_a_scale_and_a_frame_of_their_own(path):
    """A drone that hovered had them 30 times too small: what lay between them was made as much too large."""
    turn = Rotation.from_rotvec([0.3, -1.0, 0.4]).as_matrix()
    few = Similarity(0.03, turn, np.array([5.0, -7.0, 2.0])).poses(path.world_T_camera[2::4])
    found = through_few(Trajectory(T_S[2::4], few), path)
    np.testing.assert_allclose(found.world_T_camera, path.world_T_camera, atol=1e-9)


def test_frames_before_the_first_that_shows_something_and_after_the_last_do_not_count(path):
    frame = np.array([5, 5, 9, 30])
    seen = Observations(frame, np.array([0, 1, 1, 1]), np.zeros((4, 2)))
    found = seen_part(Scene(T_S, path.world_T_camera, np.zeros((2, 3)), seen))
    np.testing.assert_array_equal(found.t_s, T_S[5:31])
    np.testing.assert_array_equal(found.world_T_camera, path.world_T_camera[5:31])
    nothing = Observations(frame[:0], frame[:0], np.zeros((0, 2)))
    assert len(seen_part(Scene(T_S, path.world_T_camera, np.zeros((0, 3)), nothing))) == 0
