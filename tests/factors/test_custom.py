import gtsam
import numpy as np
import pytest

from factors import POINT3, POSE3, SCALAR, Variable, custom_factor

UNIT3 = gtsam.noiseModel.Unit.Create(3)
X1, X2 = gtsam.symbol("x", 1), gtsam.symbol("x", 2)
POSE = gtsam.Pose3.Expmap(np.array([0.3, -0.2, 0.1, 1.0, 2.0, 3.0]))


def one_pose_factor(residual, jacobians):
    return custom_factor(UNIT3, [Variable(X1, POSE3)], lambda _: (residual, jacobians))


def one_pose_values():
    values = gtsam.Values()
    values.insert(X1, POSE)
    return values


def test_equals_the_built_in_between_factor():
    measured = gtsam.Pose3.Expmap(np.array([0.1, 0.0, -0.1, 0.5, 0.0, 0.2]))
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.2, 0.3, 1.0, 2.0, 3.0]))

    def error(a, b):
        by_a, by_b, by_h = (np.zeros((6, 6), order="F") for _ in range(3))
        residual = gtsam.Pose3.Logmap(measured.inverse().compose(a.between(b, by_a, by_b)), by_h)
        return residual, [by_h @ by_a, by_h @ by_b]

    values = one_pose_values()
    values.insert(X2, gtsam.Pose3.Expmap(np.array([0.5, -0.1, 0.2, 1.5, 2.5, 2.0])))
    ours = custom_factor(noise, [Variable(X1, POSE3), Variable(X2, POSE3)], error)
    built_in = gtsam.BetweenFactorPose3(X1, X2, measured, noise)
    assert ours.error(values) == pytest.approx(built_in.error(values), rel=1e-12)
    for mine, reference in zip(
        ours.linearize(values).jacobian(), built_in.linearize(values).jacobian(), strict=True
    ):
        np.testing.assert_allclose(mine, reference, atol=1e-11)


def test_points_and_scalars_are_variables_too():
    # s * p = (2, 4, 6) with p held at (1, 2, 3): s = 2
    def error(scale, point):
        return scale * point - np.array([2.0, 4.0, 6.0]), [point[:, None], scale * np.eye(3)]

    graph = gtsam.NonlinearFactorGraph()
    graph.add(custom_factor(UNIT3, [Variable(1, SCALAR), Variable(2, POINT3)], error))
    graph.addPriorPoint3(2, np.array([1.0, 2.0, 3.0]), gtsam.noiseModel.Isotropic.Sigma(3, 1e-3))
    values = gtsam.Values()
    values.insert(1, 0.3)
    values.insert(2, np.array([1.5, 1.5, 1.5]))
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    assert result.atDouble(1) == pytest.approx(2.0, abs=1e-6)


def test_jacobians_are_not_checked_when_only_the_error_is_needed():
    factor = one_pose_factor(np.array([1.0, 2.0, 2.0]), [])
    assert factor.error(one_pose_values()) == pytest.approx(4.5)


@pytest.mark.parametrize(
    ("residual", "jacobians", "message"),
    [
        (np.ones(3), [], "x1: 0 Jacobians, expected 1"),
        (np.ones(3), [np.zeros((3, 6)), np.zeros((3, 6))], "2 Jacobians, expected 1"),
        (np.ones(3), [np.zeros((2, 6))], r"a Jacobian has shape \(2, 6\), expected \(3, 6\)"),
        (np.ones(3), [np.zeros((3, 5))], r"a Jacobian has shape \(3, 5\), expected \(3, 6\)"),
        (np.ones(3), [np.zeros(18)], r"a Jacobian has shape \(18,\)"),
        (np.ones(3), [np.full((3, 6), np.inf)], "a Jacobian is not finite"),
        (np.zeros(2), [np.zeros((2, 6))], r"the residual has shape \(2,\), expected \(3,\)"),
        (np.zeros((3, 1)), [np.zeros((3, 6))], r"the residual has shape \(3, 1\)"),
        (np.array([0.0, np.nan, 0.0]), [np.zeros((3, 6))], "the residual is not finite"),
        (np.array([np.inf, -np.inf, 0.0]), [np.zeros((3, 6))], "the residual is not finite"),
    ],
)
def test_wrong_shapes_raise_also_through_the_optimiser(residual, jacobians, message):
    factor, values = one_pose_factor(residual, jacobians), one_pose_values()
    with pytest.raises(ValueError, match=message):
        factor.linearize(values)
    graph = gtsam.NonlinearFactorGraph()
    graph.add(factor)
    with pytest.raises(ValueError, match=message):
        gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()


def test_exception_of_the_function_passes_through():
    def error(_):
        raise ZeroDivisionError("in the function")

    factor = custom_factor(UNIT3, [Variable(X1, POSE3)], error)
    with pytest.raises(ZeroDivisionError, match="in the function"):
        factor.error(one_pose_values())


def test_a_value_of_another_kind_raises():
    values = gtsam.Values()
    values.insert(X1, np.zeros(3))
    with pytest.raises(RuntimeError, match="type stored in Values"):
        one_pose_factor(np.ones(3), [np.zeros((3, 6))]).linearize(values)


@pytest.mark.parametrize("keys", [[], [X1, X1]])
def test_keys_must_be_distinct_and_present(keys):
    with pytest.raises(ValueError, match="distinct keys"):
        custom_factor(UNIT3, [Variable(key, POSE3) for key in keys], lambda *_: (np.ones(3), []))


def test_result_is_cached_for_the_same_values():
    asked = []

    def error(pose):
        asked.append(pose.translation())
        return pose.translation(), [np.hstack([np.zeros((3, 3)), pose.rotation().matrix()])]

    factor, values = custom_factor(UNIT3, [Variable(X1, POSE3)], error), one_pose_values()
    first = factor.linearize(values).jacobian()
    assert factor.error(values) == pytest.approx(POSE.translation() @ POSE.translation() / 2)
    np.testing.assert_array_equal(factor.linearize(values).jacobian()[0], first[0])
    assert len(asked) == 1
    values.update(X1, gtsam.Pose3(np.eye(4)))
    assert factor.error(values) == 0
    np.testing.assert_array_equal(factor.linearize(values).jacobian()[0][:, 3:], np.eye(3))
    assert len(asked) == 2
