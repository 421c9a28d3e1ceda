import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from factors import constant_centre_velocity_factor, constant_velocity_factor

A, B, C = (gtsam.symbol("x", k) for k in range(3))
# at most 1.7 rad between frames: clear of pi, where Log has a jump
twists = arrays(np.float64, 6, elements=st.floats(-1, 1))
times = st.floats(0.02, 2)


def values_of(a, b, c):
    values = gtsam.Values()
    for key, pose in ((A, a), (B, b), (C, c)):
        values.insert(key, pose)
    return values


@pytest.mark.slow
@settings(max_examples=40)
@given(twists, twists, twists, times, times)
def test_jacobians(check_jacobians, start, ab, bc, dt_ab_s, dt_bc_s):
    a = gtsam.Pose3.Expmap(start)
    values = values_of(a, a.expmap(ab), a.expmap(ab).expmap(bc))
    check_jacobians(constant_velocity_factor((A, B, C), (dt_ab_s, dt_bc_s), 0.5, 2.0), values)


def test_jacobians_between_identical_poses(check_jacobians):
    pose = gtsam.Pose3.Expmap(np.array([0.3, 0.2, 0.1, 1.0, 2.0, 3.0]))
    check_jacobians(constant_velocity_factor((A, B, C), (0.1, 0.2), 0.5, 2.0), values_of(pose, pose, pose))


@pytest.mark.slow
@given(twists, twists, times, times)
def test_constant_velocity_costs_nothing_at_any_spacing(start, velocity, dt_ab_s, dt_bc_s):
    a = gtsam.Pose3.Expmap(start)
    b, c = a.expmap(velocity * dt_ab_s * 0.5), a.expmap(velocity * (dt_ab_s + dt_bc_s) * 0.5)
    factor = constant_velocity_factor((A, B, C), (dt_ab_s, dt_bc_s), 0.5, 2.0)
    np.testing.assert_allclose(factor.unwhitenedError(values_of(a, b, c)), 0, atol=1e-9)


def test_residual_by_hand():
    # 2 m in 1 s, then 1 m in 0.25 s forwards; no turn, then 0.1 rad about the optical axis
    a, b = gtsam.Pose3(), gtsam.Pose3(gtsam.Rot3(), np.array([0, 0, 2.0]))
    c = b.compose(gtsam.Pose3(gtsam.Rot3.Rz(0.1), np.array([0, 0, 1.0])))
    factor = constant_velocity_factor((A, B, C), (1.0, 0.25), 0.5, 2.0)
    np.testing.assert_allclose(factor.unwhitenedError(values_of(a, b, c)), [0, 0, 0.4, 0, 0, 2.0], atol=1e-12)
    sigma = np.sqrt(1.25 / 3)
    expected = np.array([0, 0, 0.4 / (0.5 * sigma), 0, 0, 2.0 / (2.0 * sigma)])
    np.testing.assert_allclose(factor.whitenedError(values_of(a, b, c)), expected, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("steps_ab", "steps_bc"), [(50, 50), (200, 200), (40, 160)])
def test_white_acceleration_gives_unit_residuals_at_any_spacing(steps_ab, steps_bc):
    # along one axis, positions integrated in steps of 1 ms from white acceleration of density 2 m/s^1.5
    step_s, density, runs = 1e-3, 2.0, 4000
    rng = np.random.default_rng(5)
    acceleration = rng.normal(size=(runs, steps_ab + steps_bc)) * density / np.sqrt(step_s)
    position = np.cumsum(np.cumsum(acceleration, axis=1), axis=1) * step_s**2
    factor = constant_velocity_factor((A, B, C), (steps_ab * step_s, steps_bc * step_s), 0.5, density)

    def at(x):
        return gtsam.Pose3(gtsam.Rot3(), np.array([x, 0, 0]))

    whitened = [
        factor.whitenedError(values_of(at(0), at(b), at(c)))[3]
        for b, c in position[:, [steps_ab - 1, steps_ab + steps_bc - 1]]
    ]
    # 4000 samples know their standard deviation to 1.1 %
    assert np.std(whitened) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    "numbers", [(0.0, 0.1, 1.0, 1.0), (0.1, -0.1, 1.0, 1.0), (0.1, 0.1, 0.0, 1.0), (0.1, 0.1, 1.0, np.nan)]
)
def test_intervals_and_densities_are_positive(numbers):
    with pytest.raises(ValueError, match="expected positive numbers"):
        constant_velocity_factor((A, B, C), numbers[:2], *numbers[2:])


@pytest.mark.slow
@settings(max_examples=40)
@given(twists, twists, twists, st.floats(0.02, 2), st.floats(0.02, 2))
def test_jacobians_of_constant_centre_velocity(check_jacobians, a, b, c, dt_ab_s, dt_bc_s):
    values = values_of(*(gtsam.Pose3.Expmap(twist) for twist in (a, b, c)))
    check_jacobians(constant_centre_velocity_factor((A, B, C), (dt_ab_s, dt_bc_s), 2.0), values)


def test_rotation_costs_nothing_at_constant_centre_velocity():
    poses = [
        gtsam.Pose3(gtsam.Rot3.RzRyRx(0.4 * k, -k, 0.2), np.array([3.0, 1, 0]) * t)
        for k, t in enumerate((0.0, 0.1, 0.35))
    ]
    factor = constant_centre_velocity_factor((A, B, C), (0.1, 0.25), 1.0)
    np.testing.assert_allclose(factor.unwhitenedError(values_of(*poses)), 0, atol=1e-12)


def test_residual_of_constant_centre_velocity_by_hand():
    # 2 m in 1 s, then 1 m in 0.25 s: 4 - 2 m/s
    poses = [gtsam.Pose3(gtsam.Rot3.Ry(0.3), np.array([x, 0, 0])) for x in (0.0, 2.0, 3.0)]
    factor = constant_centre_velocity_factor((A, B, C), (1.0, 0.25), 2.0)
    np.testing.assert_allclose(factor.unwhitenedError(values_of(*poses)), [2, 0, 0], atol=1e-12)
    whitened = factor.whitenedError(values_of(*poses))
    np.testing.assert_allclose(whitened, [2 / (2 * np.sqrt(1.25 / 3)), 0, 0])


def test_intervals_of_the_centre_are_positive():
    with pytest.raises(ValueError, match="positive"):
        constant_centre_velocity_factor((A, B, C), (0.1, 0.0), 1.0)
