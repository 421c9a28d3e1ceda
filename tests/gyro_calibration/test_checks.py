from dataclasses import replace

import numpy as np
import pytest
from synthetic_rotations import gyro_log, noisy, one_axis, rich

from vgps.config import GyroCalibrationConfig
from vgps.errors import GeometryError, GyroLogError
from vgps.gyro_calibration import calibrate_from_rotations

CONFIG = GyroCalibrationConfig()


@pytest.mark.slow
def test_turning_about_one_axis_alone_is_refused_with_the_remedy():
    with pytest.raises(GeometryError, match=r"about one axis only .* pan, tilt and roll"):
        calibrate_from_rotations(*noisy(one_axis), CONFIG)


def still(t_s):
    return np.zeros((len(t_s), 3))


def steady(t_s):
    return np.tile([0.3, 0.2, 0.1], (len(t_s), 1))


@pytest.mark.slow
@pytest.mark.parametrize("rates", [still, steady])
def test_no_motion_and_steady_motion_are_refused(rates):
    with pytest.raises(GeometryError, match="stood still or rotated steadily"):
        calibrate_from_rotations(*noisy(rates), CONFIG)


def test_a_gyro_of_another_motion_is_refused():
    turns, _ = noisy(rich)
    with pytest.raises(GyroLogError, match=r"gyro\.csv: the rates of gyro and video correlate to 0\.\d\d"):
        calibrate_from_rotations(turns, gyro_log(lambda t: rich(1.7 * t + 3.0)[:, ::-1] ** 3, 15.0), CONFIG)


def test_mirrored_axes_are_refused():
    """A file in a left-handed frame fits no rotation."""
    turns, gyro = noisy(rich)
    mirrored = replace(gyro, rate_rad_s=gyro.rate_rad_s * [1, 1, -1])
    with pytest.raises(GyroLogError, match="correlate"):
        calibrate_from_rotations(turns, mirrored, CONFIG)


@pytest.mark.slow
def test_rates_in_degrees_are_refused():
    turns, gyro = noisy(rich)
    degrees = replace(gyro, rate_rad_s=np.degrees(gyro.rate_rad_s))
    with pytest.raises(GyroLogError, match=r"rotates 57\.\d times as far as the video; .*rad/s, not deg/s"):
        calibrate_from_rotations(turns, degrees, CONFIG)
    with pytest.raises(GyroLogError, match=r"rotates 0\.0175 times .* check the unit"):
        calibrate_from_rotations(turns, replace(gyro, rate_rad_s=np.radians(gyro.rate_rad_s)), CONFIG)
