"""Settings of the IMU in stages A to D."""

from typing import ClassVar, Literal

from pydantic import PositiveFloat

from vgps.config.base import SettingsModel
from vgps.config.quantities import Share


class ImuConfig(SettingsModel):
    """Angular rates and specific force of an IMU beside the camera; densities are of white noise."""

    basic: ClassVar[tuple[str, ...]] = ("use",)

    use: Literal["auto", "no"] = "auto"
    """Use the IMU of a recording if its rotations agree with the video's (auto), or never."""
    knot_s: PositiveFloat = 1.0
    """Time from one velocity and bias to the next; frames with fewer observations than
    tracking.min_inliers have their own."""
    gyro_density: PositiveFloat = 3e-4
    """Lower bound of the gyro's white noise, rad/s/sqrt(Hz), whatever log and rig.yaml say: samples that a
    sensor filters or rounds show less noise than it has."""
    accelerometer_density: PositiveFloat = 3e-3
    """Lower bound of the accelerometer's white noise, m/s^2/sqrt(Hz): likewise."""
    scale_error: Share = 0.005
    """Errors in proportion to what is measured: scale factors and axes that are not quite right."""
    gyro_bias_sigma: PositiveFloat = 0.05
    """Standard deviation of the gyro's bias at the start, rad/s."""
    accelerometer_bias_sigma: PositiveFloat = 0.3
    """Standard deviation of the accelerometer's bias at the start, m/s^2."""
    gyro_bias_walk: PositiveFloat = 1e-4
    """Random walk of the gyro's bias, rad/s/sqrt(s)."""
    accelerometer_bias_walk: PositiveFloat = 1e-3
    """Random walk of the accelerometer's bias, m/s^2/sqrt(s)."""
    robust_sigmas: PositiveFloat = 6.0
    """Huber's constant for the norm of the nine errors of an interval, whose mean is about 3."""
