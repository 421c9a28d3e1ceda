"""What a run reports of its IMU's biases."""

import numpy as np

from vgps.smoothing.imu_states import ImuBias


def test_biases_are_reported_in_the_axes_of_the_imu():
    covariance = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) ** 2
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert ImuBias(np.arange(6.0), covariance).report(quarter) == {
        "accelerometer_m_s2": [-1.0, 0.0, 2.0],
        "gyro_rad_s": [-4.0, 3.0, 5.0],
        "accelerometer_sigma_m_s2": [2.0, 1.0, 3.0],
        "gyro_sigma_rad_s": [5.0, 4.0, 6.0],
    }
    unknown = ImuBias(np.arange(6.0), np.full((6, 6), np.nan)).report(quarter)
    assert unknown.keys() == {"accelerometer_m_s2", "gyro_rad_s"}
