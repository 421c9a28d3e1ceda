import numpy as np
import pytest

from vgps.online.fusion.lever_arm import LeverArm


def test_standard_deviations_are_those_of_the_axes_and_a_measured_one_is_held():
    arm = LeverArm(np.zeros(3), np.array([[0.04, 0.01, 0.0], [0.01, 0.25, 0.0], [0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(arm.sigma_m, [0.2, 0.5, 1.0])
    np.testing.assert_allclose(LeverArm.within(np.ones(3), 0.3).covariance, 0.09 * np.eye(3))
    held = LeverArm.within(np.ones(3))
    assert held.sigma_m == pytest.approx(1e-4) and (held.camera_p_antenna == 1.0).all()
