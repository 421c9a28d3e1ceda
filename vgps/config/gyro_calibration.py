"""Settings of the calibration of a gyro against the video."""

from pydantic import PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel


class GyroCalibrationConfig(SettingsModel):
    """When a gyro counts as calibrated against the video."""

    least_interval_s: PositiveFloat = 0.03
    """Frames nearer to the last one than this are passed over: a turn must rise above its error."""
    search_s: PositiveFloat = 2.0
    """The clocks are taken to agree to this."""
    min_intervals: PositiveInt = 30
    """Intervals between frames with a rotation from the video and gyro rates throughout."""
    least_rate_deg_s: PositiveFloat = 0.5
    """The gyro's rate must vary by this (standard deviation), else the camera hardly turned, or steadily."""
    least_agreement: PositiveFloat = 0.85
    """Correlation of the rates of gyro and video; less, and they do not tell of the same motion."""
    max_rotation_sigma_deg: PositiveFloat = 2.0
    """Above this standard deviation, about its worst axis, the sensor's rotation is not given."""
    max_offset_sigma_s: PositiveFloat = 0.005
    """The same for the offset between the clocks."""
    max_bias_sigma_deg_s: PositiveFloat = 0.5
    """The same for the bias."""
    scale_tolerance: PositiveFloat = 0.03
    """The video may turn by this share more or less than the gyro before the focal length is doubted."""
