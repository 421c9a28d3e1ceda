import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from factors import knots_around, path_poses, path_vectors, path_weights, poses_at
from factors.continuous_path import rotation_jacobians, vector_jacobians

twists = arrays(np.float64, 6, elements=st.floats(-3, 3))
T_S = np.array([0.0, 0.1, 0.19, 0.31, 0.4, 0.5])


def poses_of(rotation: Rotation, position: np.ndarray) -> np.ndarray:
    poses = np.tile(np.eye(4), (len(position), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotation.as_matrix(), position
    return poses


def shaken(t: np.ndarray) -> np.ndarray:
    """Poses of a camera that sways by 6 degrees at 2 Hz and walks."""
    angle = np.deg2rad(6.0) * np.sin(2 * np.pi * 2.0 * t)
    turned = Rotation.from_rotvec(angle[:, None] * [0.3, 0.9, -0.3]) * Rotation.from_rotvec([0.0, 2.9, 0.5])
    return poses_of(turned, np.stack([t, 0.02 * np.sin(9 * t), 1.2 * t**2], axis=1))


def test_weights_by_hand() -> None:
    weights, rates = path_weights(np.array([[-1.0, 0.0, 1.0, 2.0]]), np.array([0.5]))
    np.testing.assert_allclose(weights, [[-1 / 16, 9 / 16, 9 / 16, -1 / 16]])
    np.testing.assert_allclose(rates, [[1 / 24, -27 / 24, 27 / 24, -1 / 24]])
    weights, rates = path_weights(np.array([[1.0, 3.0]]), np.array([2.5]))
    np.testing.assert_allclose([*weights, *rates], [[0.25, 0.75], [-0.5, 0.5]])


def test_the_nearest_four_frames_are_the_knots() -> None:
    knots = knots_around(T_S, np.array([-1, 0, 1, 2, 4, 5]))
    np.testing.assert_array_equal(knots[:, 0], [0, 0, 0, 1, 2, 2])
    np.testing.assert_array_equal(knots_around(T_S[:2], np.array([0, 7])), [[0, 1], [0, 1]])


def test_the_path_passes_through_every_frame() -> None:
    poses = shaken(T_S)
    for interval in (None, np.arange(6), np.arange(6) - 1):
        np.testing.assert_allclose(poses_at(T_S, poses, T_S, interval), poses, atol=1e-12)


@pytest.mark.slow
@given(twists)
def test_a_cubic_path_is_exact_and_goes_on_beyond_the_ends(x: np.ndarray) -> None:
    def position(t: np.ndarray) -> np.ndarray:
        return x[:3] + np.outer(t, x[3:]) + np.outer(t**2, x[:3]) - np.outer(t**3, x[3:])

    turned = Rotation.from_rotvec(np.tile(x[:3], (6, 1)))
    at = np.array([-0.02, 0.05, 0.2, 0.33, 0.52])
    path = poses_at(T_S, poses_of(turned, position(T_S)), at)
    np.testing.assert_allclose(path[:, :3, 3], position(at), atol=1e-12)
    np.testing.assert_allclose(path[:, :3, :3], turned.as_matrix()[:5], atol=1e-12)


@pytest.mark.parametrize("turn", [0.0, 3.1, 6.2])
def test_the_error_falls_with_the_fourth_power_of_the_interval(turn: float) -> None:
    at = np.linspace(0.4, 0.6, 50)
    errors = []
    for fps in (15, 30):
        t = np.arange(-3, 2 * fps) / fps
        turned = poses_of(Rotation.from_rotvec([turn, 0, 0]), np.zeros((1, 3)))
        path, truth = poses_at(t, turned @ shaken(t), at), turned @ shaken(at)
        angles = Rotation.from_matrix(np.swapaxes(path[:, :3, :3], 1, 2) @ truth[:, :3, :3]).magnitude()
        errors.append(np.degrees(angles).max())
    assert errors[0] < 0.1
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.25)


@pytest.mark.slow
@given(twists)
def test_vectors_are_quaternions_and_positions(twist: np.ndarray) -> None:
    pose = gtsam.Pose3.Expmap(twist)
    vector = path_vectors(pose.matrix()[None])[0]
    q = pose.rotation().toQuaternion()
    expected = np.array([q.w(), q.x(), q.y(), q.z()])
    np.testing.assert_allclose(abs(vector[:4] @ expected), 1.0, atol=1e-12)
    np.testing.assert_allclose(vector[4:], pose.translation())
    np.testing.assert_allclose(path_poses(2.5 * vector[None])[0, :3, :3], pose.rotation().matrix(), atol=1e-9)


@pytest.mark.slow
@given(twists, st.floats(0.3, 3.0))
def test_jacobians_are_the_derivatives(twist: np.ndarray, length: float) -> None:
    step = 1e-6
    pose = gtsam.Pose3.Expmap(twist)
    vector = path_vectors(pose.matrix()[None])[0]
    for k, d in enumerate(step * np.eye(6)):
        around = np.stack(
            [
                vector[None][0],
                *path_vectors(np.stack([pose.matrix(), pose.retract(-d).matrix(), pose.retract(d).matrix()])),
            ]
        )
        sign = np.sign(around[0, :4] @ around[1, :4])
        numerical = (around[3] - around[2]) / (2 * step) * np.where(np.arange(7) < 4, sign, 1.0)
        np.testing.assert_allclose(vector_jacobians(vector[None])[0, :, k], numerical, atol=1e-8)
    q = length * vector[:4]
    for k, d in enumerate(step * np.eye(4)):
        ends = [gtsam.Rot3(path_poses(np.append(q + s * d, np.zeros(3))[None])[0, :3, :3]) for s in (-1, 1)]
        numerical = gtsam.Rot3.Logmap(ends[0].between(ends[1])) / (2 * step)
        np.testing.assert_allclose(rotation_jacobians(q[None])[0, :, k], numerical, atol=1e-7)
