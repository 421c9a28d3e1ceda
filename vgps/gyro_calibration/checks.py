"""Checks that a recording's motion and log allow a gyro to be calibrated."""

import numpy as np

from vgps.config import GyroCalibrationConfig
from vgps.errors import GeometryError, GyroLogError
from vgps.geometry.angular_rates import RelativeRotations
from vgps.gyro_calibration.coarse import Alignment, Guess
from vgps.imu.mount_fit import Fit
from vgps.model import FloatArray, GyroLog

_REMEDY = "pan, tilt and roll the camera for a few seconds each, slowly and unevenly"


def check_motion(
    gyro_rates: FloatArray,
    camera_rates: FloatArray,
    guess: Guess,
    log: GyroLog,
    config: GyroCalibrationConfig,
) -> None:
    """Check that gyro and video recorded the same motion, and enough of it.

    Args:
        gyro_rates, camera_rates: (N, 3) mean rates over the intervals between frames, rad/s, each in its own
            axes.
        guess: The clock offset at which they agree best.
        log: For the messages.
        config: Required motion and agreement.

    Raises:
        GyroLogError: The gyro covers too few intervals, or recorded another motion or unit.
        GeometryError: The camera stood still or rotated steadily.
    """
    if len(gyro_rates) < config.min_intervals:
        found = f"the gyro covers {len(gyro_rates)} intervals between frames"
        raise GyroLogError(found, file=log.source, expected=f"at least {config.min_intervals}")
    varies = float(np.degrees(np.linalg.norm(gyro_rates.std(axis=0))))
    if varies < config.min_rate_deg_s:
        raise GeometryError(
            f"the gyro's rate varies by {varies:.2f} deg/s: the camera stood still or rotated steadily",
            expected=f"at least {config.min_rate_deg_s:g} deg/s",
            remedy=_REMEDY,
        )
    if guess.alignment.agreement < config.min_correlation:
        raise GyroLogError(
            f"the rates of gyro and video correlate to {guess.alignment.agreement:.2f} at best",
            file=log.source,
            expected=f"at least {config.min_correlation:g}",
            remedy="check video_start_s in rig.yaml, and that the video is not stabilised; " + _REMEDY,
        )
    _check_unit(gyro_rates, camera_rates, guess, log, config.unit_tolerance)


def _check_unit(
    gyro_rates: FloatArray, camera_rates: FloatArray, guess: Guess, log: GyroLog, tolerance: float
) -> None:
    spread = [np.linalg.norm(rates.std(axis=0)) for rates in (gyro_rates, camera_rates)]
    times = float(spread[0] / (guess.alignment.agreement * spread[1]))
    if not 1 / tolerance < times < tolerance:
        raise GyroLogError(
            f"the gyro rotates {times:.3g} times as far as the video",
            file=log.source,
            expected="rates in rad/s" + (", not deg/s" if times > tolerance else ""),
            remedy="check the unit, and the focal length in camera.yaml",
        )


def check_axes(
    fit: Fit, alignment: Alignment, rotations: RelativeRotations, config: GyroCalibrationConfig
) -> None:
    """Check that the camera rotated about two axes: with one, the sensor's rotation about it is undetermined.

    Raises:
        GeometryError: It rotated about one axis only.
    """
    seconds = float(np.median(rotations.end_s - rotations.start_s))
    noise = np.average(fit.residual_rad**2, axis=0, weights=fit.weight).mean() / seconds**2
    chance = config.second_axis_ratio * noise / np.sqrt(fit.weight.sum())
    sigma = float(np.degrees(np.sqrt(np.diag(fit.covariance)[:3].max())))
    if alignment.scatter[1] > chance and sigma < config.max_rotation_sigma_deg:
        return
    first, second = np.degrees(np.sqrt(alignment.scatter[:2]))
    raise GeometryError(
        f"the camera rotated about one axis only ({first:.1f} deg/s, {second:.1f} deg/s across): the "
        f"sensor's rotation about it is known to {sigma:.1f} deg",
        expected=f"at most {config.max_rotation_sigma_deg:g} deg",
        remedy=_REMEDY,
    )
