from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from factors import preintegrate_rates
from vgps.geometry.angular_rates import GyroIntegral
from vgps.model import GyroLog


def rate(t):
    return np.stack([np.sin(3 * t), 1.5 * np.cos(2 * t), 0.5 + 0.3 * np.sin(7 * t)], axis=-1)


def log_of(t_s):
    return GyroLog(t_s, rate(t_s), Path("gyro.csv"))


def test_a_steady_rate_by_hand():
    gyro = GyroLog(np.array([0.0, 1.0]), np.array([[0, 0, 0.5], [0, 0, 0.5]]), Path("gyro.csv"))
    turns = GyroIntegral(gyro).relative_rotations(np.array([0.1]), np.array([0.7]), np.array([0, 0, 0.1]))
    np.testing.assert_allclose(Rotation.from_matrix(turns[0]).as_rotvec(), [0, 0, 0.24], atol=1e-12)


def test_a_rate_that_grows_by_hand():
    # 0 to 2 rad/s in a second: from a quarter to three quarters (0.5625 - 0.0625) rad
    gyro = GyroLog(np.array([0.0, 1.0]), np.array([[0, 0, 0], [2.0, 0, 0]]), Path("gyro.csv"))
    integral = GyroIntegral(gyro)
    turns = integral.relative_rotations(np.array([0.25]), np.array([0.75]))
    np.testing.assert_allclose(Rotation.from_matrix(turns[0]).as_rotvec(), [0.5, 0, 0], atol=1e-12)
    np.testing.assert_allclose(integral.mean_rates(np.array([0.25]), np.array([0.75])), [[1.0, 0, 0]])


def test_turning_axes_against_a_differential_equation():
    start, end = np.array([0.2, 0.61, 1.0]), np.array([0.3, 1.03, 1.9])
    turns = GyroIntegral(log_of(np.linspace(0, 2, 401))).relative_rotations(start, end)
    for a, b, turn in zip(start, end, turns, strict=True):

        def slope(t, flat):
            return (flat.reshape(3, 3) @ np.cross(np.eye(3), rate(t))).ravel()

        expected = solve_ivp(slope, (a, b), np.eye(3).ravel(), rtol=1e-10, atol=1e-12).y[:, -1].reshape(3, 3)
        assert Rotation.from_matrix(expected.T @ turn).magnitude() < 5e-5


@pytest.mark.slow
@given(st.floats(0, 0.9), st.floats(0.01, 0.5), st.floats(0.01, 0.5))
def test_one_interval_after_the_other(start, first, second):
    integral = GyroIntegral(log_of(np.linspace(0, 2, 401)))
    times = np.array([start, start + first, start + first + second])
    a, b = integral.relative_rotations(times[:-1], times[1:])
    whole = integral.relative_rotations(times[:1], times[2:])[0]
    assert Rotation.from_matrix((a @ b).T @ whole).magnitude() < 1e-4


def test_the_steps_add_up_to_the_same_rotation():
    integral = GyroIntegral(log_of(np.linspace(0, 2, 401)))
    rates, dts = integral.steps(0.3012, 0.4523)
    assert dts.sum() == pytest.approx(0.1511)
    assert dts.max() <= 0.005 + 1e-12
    by_factor = preintegrate_rates(rates, dts, np.zeros(3), 1e-3).i_R_j
    turn = integral.relative_rotations(np.array([0.3012]), np.array([0.4523]))[0]
    assert Rotation.from_matrix(by_factor.T @ turn).magnitude() < 1e-5


def test_intervals_outside_the_log_or_over_gaps_are_not_covered():
    t_s = np.concatenate([np.arange(0, 1, 0.01), np.arange(1.5, 3, 0.01)])
    start = np.array([-0.1, 0.0, 0.5, 0.9, 1.2, 1.5, 2.9, 0.2])
    end = np.array([0.1, 0.9, 0.99, 1.1, 1.3, 2.0, 3.1, 2.5])
    covered = GyroIntegral(log_of(t_s)).covers(start, end)
    assert covered.tolist() == [False, True, True, False, False, True, False, False]


def test_no_intervals_give_no_rotations():
    integral = GyroIntegral(log_of(np.linspace(0, 2, 401)))
    assert integral.relative_rotations(np.zeros(0), np.zeros(0)).shape == (0, 3, 3)
