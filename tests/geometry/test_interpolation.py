import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vgps.geometry import interpolate_poses, interpolate_vectors

T_S = np.array([0.0, 1.0, 3.0])


def poses():
    out = np.tile(np.eye(4), (3, 1, 1))
    out[:, :3, 3] = [[0, 0, 0], [1, 2, 0], [1, 2, 4]]
    out[:, :3, :3] = Rotation.from_rotvec(np.radians([[0, 0, 0], [0, 0, 90], [0, 0, 90]])).as_matrix()
    return out


def test_halfway_is_half_the_distance_and_half_the_rotation():
    found = interpolate_poses(T_S, poses(), np.array([0.5, 2.0]))
    np.testing.assert_allclose(found[:, :3, 3], [[0.5, 1.0, 0.0], [1.0, 2.0, 2.0]])
    half = Rotation.from_rotvec([0.0, 0.0, np.radians(45)]).as_matrix()
    np.testing.assert_allclose(found[0, :3, :3], half, atol=1e-12)


def test_vectors_are_linear_between_samples_and_clamped_outside():
    found = interpolate_vectors(
        T_S, np.array([[0.0, 1.0], [2.0, 1.0], [2.0, 5.0]]), np.array([-1.0, 0.5, 2.0, 9.0])
    )
    np.testing.assert_allclose(found, [[0.0, 1.0], [1.0, 1.0], [2.0, 3.0], [2.0, 5.0]])


@pytest.mark.slow
@given(st.floats(-10, 10))
def test_outside_it_stays_at_the_ends_and_inside_it_is_a_rotation(at):
    found = interpolate_poses(T_S, poses(), np.array([at]))[0]
    np.testing.assert_allclose(found[:3, :3] @ found[:3, :3].T, np.eye(3), atol=1e-12)
    if at <= 0.0:
        np.testing.assert_allclose(found, poses()[0], atol=1e-12)
    if at >= 3.0:
        np.testing.assert_allclose(found, poses()[2], atol=1e-12)


def test_at_no_time_there_is_no_pose():
    assert interpolate_poses(T_S, poses(), np.zeros(0)).shape == (0, 4, 4)
