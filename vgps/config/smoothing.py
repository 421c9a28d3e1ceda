"""Settings of stages C and D: what is optimised, and what is estimated beside the poses."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import NonNegativeInt, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel


class WindowConfig(SettingsModel):
    """Stage C, Kume 2010: optimise the last frames every few frames."""

    every_frames: PositiveInt = 15
    length_frames: PositiveInt = 60
    iterations: PositiveInt = 4
    delay_frames: NonNegativeInt = 11
    """Stage C works beside the frames that follow, and what it found is used after so many of them, be it
    quick or slow, so that results repeat; 0: it is waited for."""
    tolerated_drift: PositiveFloat = 0.02
    """Antennas further outside their fix's region than this share of the way through the window show that
    what is held has drifted: then the drift is taken out first."""


class DriftConfig(SettingsModel):
    """How a camera's scale and heading may drift; from knot to knot both walk at random."""

    knot_frames: PositiveInt = 15
    scale_sigma: PositiveFloat = 0.05
    """Standard deviation of the change of the log scale from one knot to the next."""
    rotation_sigma_deg: PositiveFloat = 0.3
    """The same for the rotation."""
    iterations: PositiveInt = 30
    horizon_s: PositiveFloat = 120.0
    """Stage C takes drift out of the path, and judges fixes and clock on it, no further back than this: the
    time that it takes would else grow with the path. Stage D looks at everything."""


class SensorsConfig(SettingsModel):
    """The GPS's clock and the lever arm, where they are not known well enough."""

    renamed: ClassVar[Mapping[str, str]] = {
        "lag_s": "time_offset_s",
        "estimate_lag": "estimate_time_offset",
        "lag_sigma_s": "time_offset_sigma_s",
        "trusted_lag_s": "trusted_time_offset_s",
    }

    time_offset_s: float = 0.0
    """Positions are this much older than their time stamps say, as far as known."""
    estimate_time_offset: Literal["auto", "yes", "no"] = "auto"
    """Estimate the lag with the poses; auto keeps what it finds only if it cannot be chance."""
    time_offset_sigma_s: PositiveFloat = 0.5
    """Standard deviation of the lag before anything was seen."""
    trusted_time_offset_s: PositiveFloat = 0.02
    """Auto: clocks agree to this standard deviation where nothing is wrong; exposure and rounding of time
    stamps leave as much."""
    significant: PositiveFloat = 3.0
    """Auto: a lag is kept if it exceeds so many standard deviations."""
    estimate_antenna: bool = False
    """Estimate the antenna's place on the camera with the poses."""
    antenna_sigma_m: PositiveFloat = 0.5
    """Standard deviation of the lever arm before anything was seen."""

    @property
    def time_offset_prior_s(self) -> float:
        """Prior standard deviation of what is still unknown of the lag; 0 if it is held."""
        return 0.0 if self.estimate_time_offset == "no" else self.time_offset_sigma_s


class MotionConfig(SettingsModel):
    """What is assumed of the camera's motion, used only where frames have no features of their own."""

    rotation_density: PositiveFloat = 1.0
    """White noise on the angular acceleration, rad/s^2/sqrt(Hz)."""
    translation_density: PositiveFloat = 2.0
    """White noise on the acceleration, m/s^2/sqrt(Hz)."""


class BatchConfig(SettingsModel):
    """Stage D, Kume 2010: optimise everything once."""

    solver: Literal["schur", "gtsam"] = "schur"
    rounds: PositiveInt = 3
    """Outliers are dropped and reliabilities (13) recomputed between rounds."""
    iterations: PositiveInt = 25
    """Of a round; the last may take twice as many."""
    relative_tolerance: PositiveFloat = 1e-5
    """The last round ends once a step lowers the cost by no more than this share of it."""
    early_tolerance: PositiveFloat = 3e-4
    """The same for the rounds before, after which everything is judged anew."""
    robust_px: PositiveFloat = 1.0
    """Huber's constant on a reprojection error, in pixels, before the weights of (12)."""
    weight: Literal["per_frame", "per_observation"] = "per_observation"
    """Eq. (12) divides by the number of features in the frame; per_observation does not."""
    video_sigma_scale: PositiveFloat = 8.0
    """Pixel sigmas are multiplied by this: tracks drift together, so their errors are not independent."""
    balance: Literal["fixed", "estimated"] = "fixed"
    """Whether the scale stays, or follows the misfit of the fixes from round to round."""
    balance_worth: PositiveFloat = 4.0
    """What is believed of the fit before anything was seen counts as so many independent fixes; standard
    deviations follow the misfit as well."""
    balance_range: PositiveFloat = 8.0
    """The estimated scale stays within this factor of it."""
    draws: PositiveInt = 200
    """Draws of all errors behind the standard deviations, known to 1 / sqrt(2 draws) of themselves."""


class IntrinsicsConfig(SettingsModel):
    """The camera's calibration, refined with the poses in stage D."""

    refine: bool = False
    """Whether it is: for calibrations that are only roughly known."""
    focal_sigma: PositiveFloat = 0.05
    """Standard deviation of the focal length as it is given, as a share of it."""
    centre_sigma_px: PositiveFloat = 5.0
    """The same for the principal point."""
    distortion_sigma: PositiveFloat = 0.02
    """The same for the first two coefficients of the lens model, where it has any."""
    steps: PositiveInt = 8
    """At most so many turns between poses and calibration."""
    settled_sigmas: PositiveFloat = 0.5
    """It ends once a turn changes every number by less than this share of its standard deviation."""
