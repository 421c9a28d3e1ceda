import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import multivariate_t

from factors import (
    Cylinder,
    Ellipsoid,
    Gaussian,
    gps_factor,
    gps_factor_calibrating,
    gps_factor_interpolated,
    offset_factor,
)

A, B = gtsam.symbol("x", 0), gtsam.symbol("x", 1)
OFFSET = gtsam.symbol("o", 0)
ANTENNA = np.array([0.1, -0.3, 0.05])
PENALTIES = [
    Cylinder(2.4, 6.5, 1, 0.5),
    Cylinder(2.4, 6.5, 4, 0.5),
    Ellipsoid(4.1, 11.4, 3, 1e-3),
    Gaussian((0.5, 0.7, 2.0)),
]
SQUARES = np.array([0.25, 0.25, 4.0])  # of a cylinder's sizes
small = st.floats(-1, 1)
# rotations up to 1.7 rad from the origin and between the frames: clear of pi, where Log has a jump
twists = st.tuples(arrays(np.float64, 3, elements=small), arrays(np.float64, 3, elements=st.floats(-20, 20)))
alphas = st.sampled_from([0.0, 1.0]) | st.floats(0, 1)
late_fixes = (
    st.sampled_from(PENALTIES),
    twists,
    twists,
    alphas,
    st.floats(-0.4, 0.4),
)


def pose(twist):
    return gtsam.Pose3.Expmap(np.concatenate(twist))


def values_of(*poses):
    values = gtsam.Values()
    for key, value in zip((A, B), poses, strict=False):
        values.insert(key, value)
    return values


def assert_same_linearisation(factor, other, values):
    assert factor.error(values) == pytest.approx(other.error(values), rel=1e-12)
    for mine, reference in zip(
        factor.linearize(values).jacobian(), other.linearize(values).jacobian(), strict=True
    ):
        np.testing.assert_allclose(mine, reference, rtol=1e-12, atol=1e-12)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.sampled_from(PENALTIES), twists, arrays(np.float64, 3, elements=st.floats(-5, 5)))
def test_jacobian_at_a_frame(check_jacobians, penalty, twist, offset):
    values = values_of(pose(twist))
    fix = values.atPose3(A).transformFrom(ANTENNA) - offset
    check_jacobians(gps_factor(A, fix, ANTENNA, penalty), values)


@pytest.mark.slow
@settings(max_examples=40)
@given(st.sampled_from(PENALTIES), twists, twists, alphas, arrays(np.float64, 3, elements=st.floats(-5, 5)))
def test_jacobians_between_frames(check_jacobians, penalty, twist, motion, alpha, offset):
    values = values_of(pose(twist), pose(twist).compose(pose(motion)))
    fix = values.atPose3(A).slerp(alpha, values.atPose3(B)).transformFrom(ANTENNA) - offset
    check_jacobians(gps_factor_interpolated((A, B), alpha, fix, ANTENNA, penalty), values)


@pytest.mark.parametrize("penalty", PENALTIES)
@pytest.mark.parametrize("offset", [(0, 0, 0), (1, 0, 0), (0, 0, 1), (0, 3, 0), (0, 0, -8)])
@pytest.mark.parametrize("alpha", [0.0, 0.4, 1.0])
def test_jacobians_on_the_axes_and_between_identical_poses(check_jacobians, penalty, offset, alpha):
    where = gtsam.Pose3.Expmap(np.array([0.4, 0.1, -0.7, 3.0, 4.0, 5.0]))
    fix = where.transformFrom(ANTENNA) - np.array(offset, dtype=float)
    check_jacobians(
        gps_factor_interpolated((A, B), alpha, fix, ANTENNA, penalty), values_of(where, where), tolerance=1e-5
    )


@pytest.mark.slow
@given(twists, twists)
def test_a_fix_exactly_at_a_frame(twist, motion):
    at_a, at_b = pose(twist), pose(twist).compose(pose(motion))
    values, fix = values_of(at_a, at_b), at_a.transformFrom(ANTENNA) - np.array([1.0, 2.0, 3.0])
    for alpha, key in ((0.0, A), (1.0, B)):
        between = gps_factor_interpolated((A, B), alpha, fix, ANTENNA, PENALTIES[1])
        alone = gps_factor(key, fix, ANTENNA, PENALTIES[1])
        assert between.error(values) == pytest.approx(alone.error(values), rel=1e-9)
        jacobian, _ = between.linearize(values).jacobian()
        expected = np.zeros((3, 12))
        column = 6 * (key == B)
        expected[:, column : column + 6] = alone.linearize(values).jacobian()[0]
        np.testing.assert_allclose(jacobian, expected, atol=1e-8 * np.abs(expected).max())


@pytest.mark.slow
@given(twists)
def test_gaussian_equals_the_built_in_factors(twist):
    penalty, values, fix = Gaussian((0.5, 0.7, 2.0)), values_of(pose(twist)), np.array([3.0, -1.0, 2.0])
    built_in = gtsam.GPSFactorArm(A, fix, ANTENNA, penalty.noise_model())
    assert_same_linearisation(gps_factor(A, fix, ANTENNA, penalty), built_in, values)
    without_arm = gtsam.GPSFactor(A, fix, penalty.noise_model())
    assert_same_linearisation(gps_factor(A, fix, np.zeros(3), penalty), without_arm, values)


def test_cauchy_equals_the_built_in_factor_with_a_robust_model():
    penalty, fix = Gaussian((0.5, 0.7, 2.0), cauchy_k=2.385), np.array([3.0, -1.0, 2.0])
    values = values_of(gtsam.Pose3.Expmap(np.array([0.1, 0.2, 0.3, 4.0, 5.0, 6.0])))
    built_in = gtsam.GPSFactorArm(A, fix, ANTENNA, penalty.noise_model())
    assert_same_linearisation(gps_factor(A, fix, ANTENNA, penalty), built_in, values)


def test_interpolated_pose_follows_the_arc():
    # a quarter turn about up on a circle of radius 1 around the origin: half of it is at 45 degrees
    at_a = gtsam.Pose3(gtsam.Rot3(), np.array([1.0, 0.0, 0.0]))
    at_b = gtsam.Pose3(gtsam.Rot3.Rz(np.pi / 2), np.array([0.0, 1.0, 0.0]))
    antenna_half_way = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0]) * 1.2
    factor = gps_factor_interpolated(
        (A, B), 0.5, antenna_half_way, np.array([0.2, 0, 0]), Gaussian((1, 1, 1))
    )
    np.testing.assert_allclose(factor.unwhitenedError(values_of(at_a, at_b)), 0, atol=1e-15)


def test_the_offset_is_antenna_minus_fix():
    # looking north: camera x east, y down, z forward; antenna 0.5 m above and 0.2 m behind the camera
    looking_north = gtsam.Rot3(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
    values = values_of(gtsam.Pose3(looking_north, np.array([10.0, 20.0, 30.0])))
    factor = gps_factor(A, np.array([9.0, 20.0, 30.0]), np.array([0, -0.5, -0.2]), Gaussian((1, 1, 1)))
    np.testing.assert_allclose(factor.unwhitenedError(values), [1.0, -0.2, 0.5], atol=1e-14)


@pytest.mark.parametrize("alpha", [-0.01, 1.01, np.nan])
def test_a_fix_outside_the_two_frames_raises(alpha):
    with pytest.raises(ValueError, match="not between the two frames"):
        gps_factor_interpolated((A, B), alpha, np.zeros(3), ANTENNA, PENALTIES[0])


@pytest.mark.parametrize("fix", [np.zeros(2), np.zeros((3, 1)), np.array([0.0, np.nan, 0.0])])
def test_a_fix_is_three_finite_numbers(fix):
    with pytest.raises(ValueError, match="expected three finite numbers"):
        gps_factor(A, fix, ANTENNA, PENALTIES[0])


def test_the_factor_keeps_its_own_copy_of_the_fix():
    fix, values = np.zeros(3), values_of(gtsam.Pose3())
    factor = gps_factor(A, fix, np.zeros(3), Gaussian((1, 1, 1)))
    fix += 5
    assert factor.error(values) == 0


TIME_OFFSET, LEVER = gtsam.symbol("c", 0), gtsam.symbol("d", 0)


def with_sensors(values, time_offset_s, antenna=ANTENNA):
    values.insert(TIME_OFFSET, np.array([time_offset_s]))
    values.insert(LEVER, np.asarray(antenna, dtype=float))
    return values


@pytest.mark.slow
@settings(max_examples=40)
@given(*late_fixes, arrays(np.float64, (2, 3), elements=st.floats(-5, 5)))
def test_jacobians_with_time_offset_and_lever_arm(
    check_jacobians, penalty, twist, motion, alpha, time_offset_s, vectors
):
    values = with_sensors(values_of(pose(twist), pose(twist).compose(pose(motion))), time_offset_s)
    fix = values.atPose3(A).slerp(alpha, values.atPose3(B)).transformFrom(ANTENNA) - vectors[0]
    factor = gps_factor_calibrating((A, B), (TIME_OFFSET, LEVER), alpha, fix, vectors[1], penalty)
    check_jacobians(factor, values, tolerance=1e-5)


@pytest.mark.slow
@given(*late_fixes, arrays(np.float64, 3, elements=st.floats(-30, 30)))
def test_a_known_time_offset_moves_the_fix_ahead(penalty, twist, motion, alpha, time_offset_s, velocity):
    poses = pose(twist), pose(twist).compose(pose(motion))
    fix = poses[0].transformFrom(ANTENNA) + np.array([1.0, -2.0, 3.0])
    ahead = gps_factor_interpolated((A, B), alpha, fix + time_offset_s * velocity, ANTENNA, penalty)
    late = gps_factor_calibrating((A, B), (TIME_OFFSET, LEVER), alpha, fix, velocity, penalty)
    expected = ahead.error(values_of(*poses))
    assert late.error(with_sensors(values_of(*poses), time_offset_s)) == pytest.approx(
        expected, rel=1e-7, abs=1e-9
    )


@pytest.mark.parametrize(
    ("alpha", "velocity", "message"),
    [(1.2, np.zeros(3), "alpha is 1.2"), (0.5, np.full(3, np.nan), "world_v_antenna is")],
)
def test_a_fix_beside_its_frames_and_an_unknown_velocity_are_refused(alpha, velocity, message):
    with pytest.raises(ValueError, match=message):
        gps_factor_calibrating((A, B), (TIME_OFFSET, LEVER), alpha, np.zeros(3), velocity, PENALTIES[0])


@pytest.mark.slow
@settings(max_examples=40)
@given(
    st.sampled_from(PENALTIES), twists, twists, alphas, arrays(np.float64, (2, 3), elements=st.floats(-5, 5))
)
def test_jacobians_with_an_offset_of_the_solution(check_jacobians, penalty, twist, motion, alpha, offsets):
    values = values_of(pose(twist), pose(twist).compose(pose(motion)))
    values.insert(OFFSET, offsets[0])
    fix = values.atPose3(A).slerp(alpha, values.atPose3(B)).transformFrom(ANTENNA) - offsets[1]
    check_jacobians(gps_factor_interpolated((A, B), alpha, fix, ANTENNA, penalty, OFFSET), values)
    keys, velocity = (TIME_OFFSET, LEVER), np.array([3.0, -1.0, 0.5])
    factor = gps_factor_calibrating((A, B), keys, alpha, fix, velocity, penalty, OFFSET)
    check_jacobians(factor, with_sensors(values, 0.02), tolerance=1e-5)


@pytest.mark.slow
@given(twists, twists, alphas, arrays(np.float64, 3, elements=st.floats(-5, 5)))
def test_an_offset_moves_the_antenna_like_the_fix_moves_back(twist, motion, alpha, offset):
    values, fix = values_of(pose(twist), pose(twist).compose(pose(motion))), np.array([1.0, 2.0, 3.0])
    without = gps_factor_interpolated((A, B), alpha, fix - offset, ANTENNA, PENALTIES[1])
    expected = without.error(values)
    values.insert(OFFSET, offset)
    found = gps_factor_interpolated((A, B), alpha, fix, ANTENNA, PENALTIES[1], OFFSET)
    assert found.error(values) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.slow
@given(st.sampled_from(PENALTIES), arrays(np.float64, 3, elements=st.floats(-9, 9)), st.floats(0.01, 10.0))
def test_the_bound_of_an_offset_is_its_penalty_times_the_weight(check_jacobians, penalty, offset, weight):
    values, factor = gtsam.Values(), offset_factor(OFFSET, penalty, weight)
    values.insert(OFFSET, offset)
    assert factor.error(values) == pytest.approx(weight * penalty.cost(offset[None])[0], rel=1e-9)
    check_jacobians(factor, values)


@pytest.mark.slow
@given(arrays(np.float64, 3, elements=st.floats(-9, 9)), st.floats(0.01, 10.0), st.floats(0.5, 50.0))
def test_a_bound_of_unknown_size_is_students_t_in_space(offset, weight, tail):
    values = gtsam.Values()
    values.insert(OFFSET, offset)
    factor = offset_factor(OFFSET, Cylinder(0.5, 2.0, 1, 0.5), weight, tail)
    density = multivariate_t(shape=np.diag(SQUARES), df=tail)
    expected = weight * (density.logpdf(np.zeros(3)) - density.logpdf(offset))
    assert factor.error(values) == pytest.approx(expected, rel=1e-7, abs=1e-9)
    jacobian, right = factor.linearize(values).jacobian()  # reweighted: its gradient is that of the cost
    gradient = weight * (tail + 3.0) / (tail + offset @ (offset / SQUARES)) * offset / SQUARES
    np.testing.assert_allclose(-jacobian.T @ right, gradient, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("number", [0.0, -1.0, float("nan")])
def test_weight_and_tail_of_a_bound_are_positive(number):
    with pytest.raises(ValueError, match=f"weight is {number}"):
        offset_factor(OFFSET, PENALTIES[0], number)
    with pytest.raises(ValueError, match=f"tail {number}"):
        offset_factor(OFFSET, PENALTIES[0], 1.0, number)
