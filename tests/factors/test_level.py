import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from factors import CAMERA_RIGHT_AND_FORWARD, level_factor

X = gtsam.symbol("x", 0)
LEVEL = gtsam.Rot3(np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))  # looks north


def values_of(rotation):
    values = gtsam.Values()
    values.insert(X, gtsam.Pose3(rotation, np.array([3.0, -2.0, 1.0])))
    return values


def test_an_upright_camera_costs_nothing_whatever_its_heading():
    factor = level_factor(X, CAMERA_RIGHT_AND_FORWARD, [0.1, 0.5])
    for heading in np.linspace(0, 6, 7):
        assert factor.error(values_of(gtsam.Rot3.Rz(heading) * LEVEL)) == pytest.approx(0.0, abs=1e-20)


def test_roll_and_pitch_are_measured_in_their_own_sigmas():
    factor = level_factor(X, CAMERA_RIGHT_AND_FORWARD, [0.1, 0.5])
    rolled = factor.whitenedError(values_of(LEVEL * gtsam.Rot3.Rz(0.3)))
    np.testing.assert_allclose(np.abs(rolled), [np.sin(0.3) / 0.1, 0.0], atol=1e-12)
    pitched = factor.whitenedError(values_of(LEVEL * gtsam.Rot3.Rx(0.3)))
    np.testing.assert_allclose(np.abs(pitched), [0.0, np.sin(0.3) / 0.5], atol=1e-12)


def test_an_axis_that_the_ground_shows_is_level_in_a_camera_that_is_not():
    rolled = LEVEL * gtsam.Rot3.Rz(0.3)
    level_axis = rolled.matrix().T @ [1.0, 0.0, 0.0]  # east
    factor = level_factor(X, level_axis[None], [0.1])
    assert factor.error(values_of(rolled)) == pytest.approx(0.0, abs=1e-20)
    assert factor.unwhitenedError(values_of(LEVEL)) == pytest.approx([np.sin(0.3)])


@pytest.mark.slow
@given(arrays(np.float64, 3, elements=st.floats(-2, 2)))
def test_jacobians(check_jacobians, rotation_vector):
    factor = level_factor(X, CAMERA_RIGHT_AND_FORWARD, [0.1, 0.5])
    check_jacobians(factor, values_of(gtsam.Rot3.Expmap(rotation_vector)))


def test_refuses_sigmas_that_are_not_positive():
    with pytest.raises(ValueError, match="expected positive"):
        level_factor(X, CAMERA_RIGHT_AND_FORWARD, [0.0, 1.0])
