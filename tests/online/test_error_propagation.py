import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.config import DriftConfig
from vgps.online.error_propagation import (
    PATH_ERRORS,
    POSITION,
    ROTATION,
    SCALE,
    cross_matrices,
    fix_measurement,
    transitions,
    unknown_covariance,
    updated,
    with_level_axis,
)

STILL = DriftConfig(scale_sigma=1e-12, rotation_sigma_deg=1e-12)
CORRELATION_S = np.array([60.0])
vectors = st.tuples(*[st.floats(-9.0, 9.0)] * 3).map(np.array)


def carried(covariance, steps, interval_s=0.1, drift=STILL, moving=True):
    count = len(steps)
    F, grown = transitions(
        np.array(steps), np.full(count, interval_s), np.full(count, moving), drift, CORRELATION_S
    )
    for k in range(count):
        covariance = F[k] @ covariance @ F[k].T + np.diag(grown[k])
    return covariance


def known(scale=0.0, turn=(0.0, 0.0, 0.0)):
    sigma = np.zeros(PATH_ERRORS + 3)
    sigma[SCALE], sigma[ROTATION], sigma[PATH_ERRORS:] = scale, turn, 1.0
    return np.diag(sigma**2)


@given(vectors, vectors)
def test_the_matrix_of_the_cross_product(a, b):
    np.testing.assert_allclose(cross_matrices(a) @ b, np.cross(a, b), atol=1e-12)


def test_scale_and_heading_errors_make_position_errors_grow_with_distance():
    after = carried(known(scale=0.02, turn=(0.0, 0.0, 0.01)), [[1.0, 0.0, 0.0]] * 50)
    # 50 m east: 2 % along, 0.01 rad across, nothing up
    np.testing.assert_allclose(np.sqrt(np.diagonal(after)[POSITION]), [1.0, 0.5, 0.0], atol=1e-9)


def test_drift_is_that_of_its_knots_and_stops_with_the_camera():
    drift = DriftConfig(knot_frames=15, scale_sigma=0.05, rotation_sigma_deg=0.3)
    after = carried(known(), [[0.0, 0.0, 0.0]] * 60, drift=drift)
    assert np.sqrt(after[SCALE, SCALE]) == pytest.approx(0.1)  # four knots
    assert np.degrees(np.sqrt(np.diagonal(after)[ROTATION])) == pytest.approx([0.6] * 3)
    assert carried(known(), [[0.0, 0.0, 0.0]] * 60, drift=drift, moving=False)[SCALE, SCALE] == 0.0


def fixed(covariance, sigma_m=2.0):
    H = fix_measurement(len(covariance), np.zeros(3), np.full(3, sigma_m), 0)
    return updated(covariance, H, 0.01)


@pytest.mark.parametrize(("apart_s", "fewest", "most"), [(0.1, 1.95, 2.0), (600.0, 0.62, 0.65)])
def test_many_fixes_are_better_than_one_only_if_their_errors_are_independent(apart_s, fewest, most):
    covariance = unknown_covariance(1)
    for _ in range(10):
        covariance = carried(fixed(covariance), [[0.0, 0.0, 0.0]], apart_s)
    # alike: 2 m still; new each time: 2 m / sqrt(10)
    assert fewest < np.sqrt(covariance[0, 0]) < most


def test_with_a_lever_arm_a_fix_measures_rotation():
    H = fix_measurement(PATH_ERRORS + 3, np.array([0.0, 2.0, 0.0]), np.full(3, 0.5), 0)
    turn = np.array([0.0, 0.0, 0.1])
    # about the vertical, an antenna 2 m north of the camera goes west
    np.testing.assert_allclose(H[:, ROTATION] @ turn, [-0.2, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(H[:, POSITION], np.eye(3))


def test_a_level_axis_measures_the_roll():
    after = with_level_axis(
        unknown_covariance(1), np.array([0.0, 1.0, 0.0]), 0.05
    )  # north, level: a turn about east lifts it
    turn = np.sqrt(np.diagonal(after)[ROTATION])
    np.testing.assert_allclose(turn, [0.05, 1.0, 1.0], rtol=2e-3)
