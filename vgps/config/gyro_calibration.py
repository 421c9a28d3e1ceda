"""Settings of the calibration of a gyro against the video."""

from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.config.quantities import Fraction, Share


class RotationConfig(SettingsModel):
    """The rotation between two frames, from their features alone."""

    min_matches: PositiveInt = 30
    """Features needed in both frames."""
    min_inlier_share: Share = 0.5
    """A rotation is rejected if a smaller share of the matches fits one rigid scene."""
    inlier_px: PositiveFloat = 1.0
    """Matches whose Sampson distance exceeds this are outliers; also the constant of Cauchy's loss."""
    sigma_floor_px: PositiveFloat = 0.05
    """Lower bound of the standard deviation of a match: no matcher is more accurate."""
    min_response: Share = 0.05
    """The shift of the whole image is used if the response of phase correlation exceeds this."""


class GyroCalibrationConfig(SettingsModel):
    """When a gyro counts as calibrated against the video."""

    renamed: ClassVar[Mapping[str, str]] = {
        "least_interval_s": "min_interval_s",
        "least_rate_deg_s": "min_rate_deg_s",
        "least_agreement": "min_correlation",
    }

    min_interval_s: PositiveFloat = 0.03
    """Frames closer to the last one are skipped: a rotation must exceed its own error."""
    search_s: PositiveFloat = 2.0
    """Largest time offset between gyro and video that is searched, either way."""
    min_overlap_share: Share = 0.5
    """A time offset is considered if the gyro then covers at least this share of the intervals."""
    max_rate_ratio: float = Field(default=4.0, ge=1.0)
    """Rates of the video are cut to this many times their median while the time offset is searched."""
    ambiguity_ratio: float = Field(default=2.0, ge=1.0)
    """The time offset is not given if another leaves less than this times its 1 - correlation."""
    robust_sigmas: PositiveFloat = 2.5
    """Cauchy's constant: intervals with a larger residual count less and less."""
    min_intervals: PositiveInt = 30
    """Intervals needed that have a rotation from the video and gyro rates throughout."""
    min_rate_deg_s: PositiveFloat = 0.5
    """Standard deviation needed of the gyro's rates; below it the camera hardly turned, or turned
    steadily."""
    min_correlation: Fraction = 0.85
    """Correlation needed between the rates of gyro and video; below it they show different motions."""
    unit_tolerance: float = Field(default=2.0, gt=1.0)
    """The gyro's unit is doubted if its rates differ from the video's by more than this factor."""
    second_axis_ratio: PositiveFloat = 3.0
    """Rotation needed about a second axis, as a multiple of what errors alone would show there."""
    max_rotation_sigma_deg: PositiveFloat = 2.0
    """The sensor's rotation is not given if its sigma about the worst axis exceeds this."""
    max_offset_sigma_s: PositiveFloat = 0.005
    """The time offset is not given if its sigma exceeds this."""
    max_bias_sigma_deg_s: PositiveFloat = 0.5
    """The bias is not given if its sigma exceeds this."""
    rotation: RotationConfig = RotationConfig()
    scale_tolerance: Share = 0.03
    """The focal length is doubted if the video turns by more than this share more or less than the gyro."""
