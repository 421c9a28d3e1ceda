import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from factors import known_points_factor

A, B, C = (gtsam.symbol("x", k) for k in range(3))
K = np.array([[500.0, 0, 320], [0, 480, 240], [0, 0, 1]])
POINTS = np.array([[1.0, 0.5, 8], [-2, 1, 12], [0.3, -0.7, 5], [3, 2, 20]])
small = arrays(np.float64, 6, elements=st.floats(-0.2, 0.2))


def values_of(*poses):
    values = gtsam.Values()
    for key, pose in zip((A, B, C), poses, strict=False):
        values.insert(key, pose)
    return values


def exact_pixels():
    homogeneous = POINTS @ K.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@pytest.mark.slow
@given(small, st.floats(0.5, 50))
def test_jacobian(check_jacobians, twist, huber_px):
    factor = known_points_factor(
        A, POINTS, exact_pixels() + np.array([0.3, -0.2]), np.array([1, 2, 0.5, 1]), K, huber_px
    )
    check_jacobians(factor, values_of(gtsam.Pose3.Expmap(twist)), step=1e-6, tolerance=1e-5)


def test_exact_observations_have_no_residual():
    factor = known_points_factor(A, POINTS, exact_pixels(), np.ones(4), K, 1.0)
    np.testing.assert_allclose(factor.unwhitenedError(values_of(gtsam.Pose3())), 0, atol=1e-10)


@pytest.mark.parametrize("off_px", [0.5, 3.0, 40.0])
def test_the_cost_is_gtsams_huber(off_px):
    uv = exact_pixels()
    uv[1] += (0.6 * off_px, 0.8 * off_px)
    factor = known_points_factor(A, POINTS, uv, np.full(4, 2.0), K, 1.5)
    # gtsam's loss acts on the whitened length, so that its constant is 1.5 px over 2 px
    loss = gtsam.noiseModel.mEstimator.Huber.Create(1.5 / 2).loss(off_px / 2)
    assert factor.error(values_of(gtsam.Pose3())) == pytest.approx(loss)


def test_landmark_behind_the_camera_contributes_nothing(check_jacobians):
    points, uv = np.vstack([POINTS, [0, 0, -5.0]]), np.vstack([exact_pixels(), [0, 0]])
    factor = known_points_factor(A, points, uv, np.ones(5), K, 1.0)
    assert factor.error(values_of(gtsam.Pose3())) == pytest.approx(0, abs=1e-18)
    check_jacobians(factor, values_of(gtsam.Pose3.Expmap(np.full(6, 0.01))), step=1e-6)


@pytest.mark.parametrize(
    "changed",
    [{"sigma_px": np.zeros(4)}, {"sigma_px": np.ones(3)}, {"huber_px": 0.0}, {"uv_px": np.zeros((3, 2))}],
)
def test_impossible_arguments(changed):
    given_ = {"uv_px": exact_pixels(), "sigma_px": np.ones(4), "huber_px": 1.0} | changed
    with pytest.raises(ValueError):
        known_points_factor(A, POINTS, given_["uv_px"], given_["sigma_px"], K, given_["huber_px"])


def test_no_points():
    with pytest.raises(ValueError, match="expected"):
        known_points_factor(A, np.zeros((0, 3)), np.zeros((0, 2)), np.zeros(0), K, 1.0)
