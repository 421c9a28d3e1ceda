import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from factors import (
    control_point_factor,
    projection_factor,
    projection_noise,
    projection_sigma_px,
    reliability_sigma_px,
)

K = gtsam.Cal3_S2(700.0, 710.0, 0.0, 320.0, 240.0)
X, L = gtsam.symbol("x", 0), gtsam.symbol("l", 0)
twists = arrays(np.float64, 6, elements=st.floats(-1, 1))
points_in_front = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(2, 50)).map(np.array)


def values_of(pose, point=None):
    values = gtsam.Values()
    values.insert(X, pose)
    if point is not None:
        values.insert(L, point)
    return values


def test_reliability_by_hand():
    # track 0: squares 25 and 1, mean 13; track 1: 0.04, below the floor; track 2: never seen
    residual_px = np.array([[3.0, 4.0], [0.0, 0.2], [1.0, 0.0]])
    sigma_px = reliability_sigma_px(residual_px, np.array([0, 1, 0]), 3, floor_px=0.3)
    np.testing.assert_allclose(sigma_px, [np.sqrt(13), 0.3, np.nan])


def test_reliability_estimates_the_spread_of_each_track():
    rng = np.random.default_rng(1)
    truth = np.array([0.5, 1.0, 3.0])
    landmark = np.tile(np.arange(3), 20_000)
    residual_px = rng.normal(size=(60_000, 2)) * truth[landmark, None]
    # the mean square is of the two-vector: twice the variance of a coordinate
    np.testing.assert_allclose(
        reliability_sigma_px(residual_px, landmark, 3, 0.1), truth * np.sqrt(2), rtol=0.02
    )


def test_reliability_needs_a_floor():
    with pytest.raises(ValueError, match="floor_px is 0"):
        reliability_sigma_px(np.zeros((1, 2)), np.array([0]), 1, 0.0)


def test_projection_sigma_makes_equation_12():
    # frame 4 sees three features, frame 6 one
    frame, landmark = np.array([4, 4, 6, 4]), np.array([0, 1, 1, 2])
    sigma_px = np.array([1.0, 2.0, 0.5])
    sigma = projection_sigma_px(sigma_px, landmark, frame)
    np.testing.assert_allclose(sigma, [np.sqrt(3), 2 * np.sqrt(3), 2.0, 0.5 * np.sqrt(3)])
    residual_px = np.array([[1.0, 0.0], [0.0, 2.0], [3.0, 4.0], [1.0, 1.0]])
    square = np.sum(residual_px**2, axis=1)
    phi_4 = (square[0] / (2 * 1.0) + square[1] / (2 * 4.0) + square[3] / (2 * 0.25)) / 3
    phi_6 = square[2] / (2 * 4.0)
    cost = sum(
        projection_noise(s).loss(projection_noise(s).squaredMahalanobisDistance(e))
        for s, e in zip(sigma, residual_px, strict=True)
    )
    assert cost == pytest.approx(phi_4 + phi_6)


def huber(length_px, bend_px):
    return length_px**2 / 2 if length_px < bend_px else bend_px * (length_px - bend_px / 2)


def cauchy(length_px, bend_px):
    return bend_px**2 / 2 * np.log1p((length_px / bend_px) ** 2)


@pytest.mark.parametrize(("name", "loss"), [("huber", huber), ("cauchy", cauchy)])
@pytest.mark.parametrize("features", [1, 400])
@pytest.mark.parametrize("length_px", [0.5, 2.9, 3.1, 40.0])
def test_the_loss_has_the_same_scale_in_pixels_for_any_weight(name, loss, features, length_px):
    sigma_j = 0.7
    pose, point = gtsam.Pose3(), np.array([0.0, 0.0, 10.0])
    noise = projection_noise(sigma_j * np.sqrt(features), name, loss_px=3.0)
    uv_px = np.array([320.0, 240.0]) + length_px * np.array([0.6, 0.8])
    factor = projection_factor(X, L, uv_px, K, noise)
    expected = loss(length_px, 3.0) / (sigma_j**2 * features)
    assert factor.error(values_of(pose, point)) == pytest.approx(expected, rel=1e-9)


def test_a_loss_needs_a_scale():
    with pytest.raises(ValueError, match="loss_px is 0"):
        projection_noise(1.0, "huber", 0.0)


@pytest.mark.slow
@given(twists, points_in_front)
def test_projection_factor(check_jacobians, twist, camera_p_point):
    pose = gtsam.Pose3.Expmap(twist)
    values = values_of(pose, pose.transformFrom(camera_p_point))
    factor = projection_factor(X, L, np.array([300.0, 250.0]), K, projection_noise(2.0))
    x, y, z = camera_p_point
    np.testing.assert_allclose(
        factor.unwhitenedError(values), [700 * x / z + 20, 710 * y / z - 10], rtol=1e-9, atol=1e-9
    )
    check_jacobians(factor, values)


@pytest.mark.slow
@given(twists, points_in_front)
def test_control_point_equals_a_landmark_that_is_held(check_jacobians, twist, camera_p_point):
    pose = gtsam.Pose3.Expmap(twist)
    point, uv_px = pose.transformFrom(camera_p_point), np.array([300.0, 250.0])
    control = control_point_factor(X, uv_px, point, K, projection_noise(2.0))
    landmark = projection_factor(X, L, uv_px, K, projection_noise(2.0))
    values = values_of(pose, point)
    assert control.error(values) == pytest.approx(landmark.error(values), rel=1e-12)
    jacobian, _ = control.linearize(values).jacobian()
    np.testing.assert_allclose(
        jacobian, landmark.linearize(values).jacobian()[0][:, :6], rtol=1e-9, atol=1e-9
    )
    check_jacobians(control, values_of(pose))


@pytest.mark.parametrize("depth_m", [-5.0, 0.0])
def test_behind_the_camera_nothing_raises(depth_m):
    point = np.array([1.0, 2.0, depth_m])
    values = values_of(gtsam.Pose3(), point)
    control = control_point_factor(X, np.zeros(2), point, K, projection_noise(2.0))
    landmark = projection_factor(X, L, np.zeros(2), K, projection_noise(2.0))
    np.testing.assert_array_equal(control.unwhitenedError(values), [1400.0, 1400.0])
    assert control.error(values) == landmark.error(values)
    np.testing.assert_array_equal(control.linearize(values).jacobian()[0], np.zeros((2, 6)))


def test_six_control_points_give_the_pose():
    truth = gtsam.Pose3(gtsam.Rot3.Ypr(0.3, -0.2, 0.1), np.array([1.0, -2.0, 0.5]))
    rng = np.random.default_rng(3)
    graph = gtsam.NonlinearFactorGraph()
    for camera_p_point in rng.uniform([-3, -2, 4], [3, 2, 20], size=(6, 3)):
        point = truth.transformFrom(camera_p_point)
        uv_px = gtsam.PinholeCameraCal3_S2(truth, K).project(point)
        graph.add(control_point_factor(X, uv_px, point, K, projection_noise(1.0)))
    start = values_of(truth.retract(np.array([0.1, -0.1, 0.05, 0.3, 0.2, -0.3])))
    result = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize().atPose3(X)
    np.testing.assert_allclose(result.matrix(), truth.matrix(), atol=1e-6)
