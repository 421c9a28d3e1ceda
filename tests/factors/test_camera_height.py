import gtsam
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from factors import camera_height_factor

A, B, H = gtsam.symbol("x", 0), gtsam.symbol("x", 1), gtsam.symbol("h", 0)


def values_of(rotation_vector, distance: float, height: float) -> gtsam.Values:
    values, rotation = gtsam.Values(), gtsam.Rot3.Expmap(rotation_vector)
    values.insert(A, gtsam.Pose3(rotation, np.array([3.0, -2.0, 1.0])))
    values.insert(B, gtsam.Pose3(rotation, np.array([3.0, -2.0, 1.0]) + distance * np.array([0.6, 0.0, 0.8])))
    values.insert(H, np.array([height]))
    return values


def test_ten_metres_are_six_heights():
    factor = camera_height_factor((A, B), H, ratio=1.6 / 10.0, sigma=0.02)
    assert factor.error(values_of(np.zeros(3), 10.0, 1.6)) == pytest.approx(0.0, abs=1e-20)
    stretched = factor.whitenedError(values_of(np.zeros(3), 11.0, 1.6))
    np.testing.assert_allclose(stretched, [np.log(1.1) / 0.02])


@pytest.mark.slow
@given(arrays(np.float64, 3, elements=st.floats(-2, 2)), st.floats(0.5, 30), st.floats(0.3, 3))
def test_jacobians(check_jacobians, rotation_vector, distance, height):
    check_jacobians(camera_height_factor((A, B), H, 0.2, 0.5), values_of(rotation_vector, distance, height))


@pytest.mark.parametrize(("ratio", "sigma"), [(0.0, 0.1), (0.2, -0.1)])
def test_refuses_what_is_not_positive(ratio, sigma):
    with pytest.raises(ValueError, match="expected positive"):
        camera_height_factor((A, B), H, ratio, sigma)
