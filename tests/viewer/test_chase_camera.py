"""The virtual camera behind the camera."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.transform import Rotation

from vgps.solution import Solution, Trajectory
from vgps.viewer.chase_camera import chase_poses, chase_scale_m


def test_it_is_behind_and_above_and_looks_at_the_camera(solution: Solution) -> None:
    centres, rotations = chase_poses(solution.trajectory)
    scale = chase_scale_m(solution.trajectory)
    assert scale == 5.0  # 10 m/s, at most 5 m
    np.testing.assert_allclose(centres - solution.world_T_camera[:, :3, 3], np.tile([0, -25.0, 17.5], (6, 1)))
    camera = np.einsum("nji,nj->ni", rotations, solution.world_T_camera[:, :3, 3] - centres)
    np.testing.assert_allclose(camera[:, 0], 0.0, atol=1e-9)
    assert (camera[:, 2] > 0).all()


def test_a_standing_camera_is_shown_from_nearby(solution: Solution) -> None:
    standing = replace(solution, world_T_camera=np.tile(solution.world_T_camera[0], (6, 1, 1)))
    assert chase_scale_m(standing.trajectory) == pytest.approx(0.3)


@pytest.mark.slow
@given(
    hnp.arrays(float, (6, 4), elements=st.floats(-1, 1)).filter(
        lambda q: np.linalg.norm(q, axis=1).min() > 0.1
    )
)
def test_it_is_level_whatever_the_rotation_of_the_camera(quaternions: np.ndarray) -> None:
    poses = np.tile(np.eye(4), (6, 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(quaternions).as_matrix()
    _, rotations = chase_poses(Trajectory(np.arange(6) / 10, poses))
    np.testing.assert_allclose(
        rotations @ rotations.transpose(0, 2, 1), np.tile(np.eye(3), (6, 1, 1)), atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)
    np.testing.assert_allclose(rotations[:, 2, 0], 0.0, atol=1e-9)  # right is horizontal
    assert (rotations[:, 2, 1] < 0).all()  # down is down
