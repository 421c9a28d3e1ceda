import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from factors import constant_centre_velocity_factor, known_points_factor

A, B, C = (gtsam.symbol("x", k) for k in range(3))
K = np.array([[500.0, 0, 320], [0, 480, 240], [0, 0, 1]])
POINTS = np.array([[1.0, 0.5, 8], [-2, 1, 12], [0.3, -0.7, 5], [3, 2, 20]])
small = arrays(np.float64, 6, elements=st.floats(-0.2, 0.2))
twists = arrays(np.float64, 6, elements=st.floats(-1, 1))


def values_of(*poses):
    values = gtsam.Values()
    for key, pose in zip((A, B, C), poses, strict=False):
        values.insert(key, pose)
    return values


def exact_pixels():
    homogeneous = POINTS @ K.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@given(small, st.floats(0.5, 50))
def test_jacobian(check_jacobians, twist, huber_px):
    factor = known_points_factor(
        A, POINTS, exact_pixels() + np.array([0.3, -0.2]), np.array([1, 2, 0.5, 1]), K, huber_px
    )
    check_jacobians(factor, values_of(gtsam.Pose3.Expmap(twist)), step=1e-6, tolerance=1e-5)


def test_no_residual_where_every_landmark_is_where_it_was_seen():
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


def test_a_landmark_behind_the_camera_has_no_part(check_jacobians):
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


@given(twists, twists, twists, st.floats(0.02, 2), st.floats(0.02, 2))
def test_jacobians_of_the_steady_centre(check_jacobians, a, b, c, dt_ab_s, dt_bc_s):
    values = values_of(*(gtsam.Pose3.Expmap(twist) for twist in (a, b, c)))
    check_jacobians(constant_centre_velocity_factor((A, B, C), (dt_ab_s, dt_bc_s), 2.0), values)


def test_turning_costs_nothing_while_the_centre_is_steady():
    poses = [
        gtsam.Pose3(gtsam.Rot3.RzRyRx(0.4 * k, -k, 0.2), np.array([3.0, 1, 0]) * t)
        for k, t in enumerate((0.0, 0.1, 0.35))
    ]
    factor = constant_centre_velocity_factor((A, B, C), (0.1, 0.25), 1.0)
    np.testing.assert_allclose(factor.unwhitenedError(values_of(*poses)), 0, atol=1e-12)


def test_residual_of_the_steady_centre_by_hand():
    # 2 m in 1 s, then 1 m in 0.25 s: 4 - 2 m/s
    poses = [gtsam.Pose3(gtsam.Rot3.Ry(0.3), np.array([x, 0, 0])) for x in (0.0, 2.0, 3.0)]
    factor = constant_centre_velocity_factor((A, B, C), (1.0, 0.25), 2.0)
    np.testing.assert_allclose(factor.unwhitenedError(values_of(*poses)), [2, 0, 0], atol=1e-12)
    whitened = factor.whitenedError(values_of(*poses))
    np.testing.assert_allclose(whitened, [2 / (2 * np.sqrt(1.25 / 3)), 0, 0])


def test_impossible_times():
    with pytest.raises(ValueError, match="positive"):
        constant_centre_velocity_factor((A, B, C), (0.1, 0.0), 1.0)
