"""Settings of stages C and D: what is optimised, and what is estimated beside the poses."""

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.config.quantities import Share
from vgps.model import FloatArray


class WindowConfig(SettingsModel):
    """Stage C, Kume 2010: optimise the last frames every few frames."""

    basic: ClassVar[tuple[str, ...]] = ("solver", "every_frames", "length_frames")

    solver: Literal["schur", "isam2"] = "schur"
    """Stage C holds older frames (schur), or marginalises them by iSAM2 (on trial; no rolling shutter)."""
    every_frames: PositiveInt = 15
    """Frames from one optimisation of the window to the next."""
    length_frames: PositiveInt = 60
    """Frames in the window."""
    iterations: PositiveInt = 4
    """Steps of an optimisation at most."""
    rough_factor: PositiveInt = 3
    """Factor on iterations where drift was corrected before, or a map begins without fixes."""
    corrected_tolerance: float = Field(default=5.0, ge=1.0)
    """Factor on mapping.max_reprojection_px where drift was corrected: long tracks fit badly there."""
    delay_frames: NonNegativeInt = 11
    """Frames after which a window's result is used, however quickly it was found, so that results repeat."""
    tolerated_drift: Share = 0.02
    """Drift is corrected first if antennas leave their fixes' regions by more than this share of the path."""
    min_shared_fixes: PositiveInt = 3
    """Fixes needed in the window to correct a smaller offset from the antennas that all of them share."""
    bend_s: PositiveFloat = 1.0
    """Once a fix turns out wrong, the path's bending towards it is undone from this long before it on."""
    min_features: PositiveInt = 12
    """Frames after the window that see fewer of its features keep their tracked motion."""
    max_failures: PositiveInt = 3
    """A new map begins after this many windows in succession that could not be optimised."""


class DriftConfig(SettingsModel):
    """How the camera's scale and heading may drift: both walk at random from knot to knot."""

    removed: ClassVar[Mapping[str, str]] = {"max_knots": "knots lie knot_frames apart, however long the path"}

    knot_frames: PositiveInt = 15
    """Frames from one knot of the drift model to the next."""
    scale_sigma: Share = 0.05
    """Standard deviation of the change in log scale from one knot to the next."""
    rotation_sigma_deg: PositiveFloat = 0.3
    """Standard deviation of the rotation, about each axis, from one knot to the next."""
    coarsest_m: PositiveFloat = 5.0
    """A fit begins with all regions enlarged by at least this: a wrong path then agrees with its fixes."""
    finest_m: PositiveFloat = 0.3
    """Stage C ends the coarse fits here; a last one has the regions as they are."""
    refinement_ratio: float = Field(default=3.0, gt=1.0)
    """From one fit to the next, regions are enlarged this many times less."""
    robust_regions: PositiveFloat = 3.0
    """Cauchy's constant of the last fit, in regions: fixes further off count less and less."""
    iterations: PositiveInt = 30
    """Steps of a fit of the drift at most."""
    horizon_s: PositiveFloat = 120.0
    """Stage C corrects drift and judges fixes this far back; stage D uses the whole recording."""


class TimeOffsetConfig(SettingsModel):
    """How the time offset is found: displacements between fixes against those of the camera."""

    max_pair_s: PositiveFloat = 3.0
    """Two neighbouring fixes are compared if they lie no further apart than this."""
    search_sigmas: PositiveFloat = 3.0
    """The search reaches this many prior standard deviations to either side."""
    search_step_s: PositiveFloat = 0.05
    """Step of the coarse search; a fraction of the time that a vehicle needs to turn."""
    knot_s: PositiveFloat = 20.0
    """Errors of the camera's scale and heading change evenly between knots this far apart."""
    factor_sigma: Share = 0.05
    """Prior standard deviation of these errors, as a share and in radians."""
    common_factor_sigma: NonNegativeFloat = 1.0
    """That of what they have in common: on a bend, a path laid on fixes of another clock is turned."""
    robust_spreads: PositiveFloat = 2.0
    """Cauchy's constant, in spreads of the differences between the displacements."""
    shown_share: Share = 0.5
    """The motion shows the time offset if its sigma is below this share of the prior one."""
    min_fixes: PositiveInt = 30
    """Fixes needed to change a time offset that earlier ones gave."""


class SensorsConfig(SettingsModel):
    """The GPS clock and the lever arm, where they are not known well enough."""

    renamed: ClassVar[Mapping[str, str]] = {
        "lag_s": "time_offset_s",
        "estimate_lag": "estimate_time_offset",
        "lag_sigma_s": "time_offset_sigma_s",
        "trusted_lag_s": "trusted_time_offset_s",
        "significant": "significance_sigmas",
    }
    basic: ClassVar[tuple[str, ...]] = ("time_offset_s", "estimate_time_offset", "estimate_antenna")

    time_offset_s: float = 0.0
    """Known time offset of GPS: fixes are older than their time stamps by this."""
    estimate_time_offset: Literal["auto", "yes", "no"] = "auto"
    """Estimate the rest of the time offset with the poses; auto keeps it only if it cannot be chance."""
    time_offset_sigma_s: PositiveFloat = 0.5
    """Prior standard deviation of the time offset that is estimated."""
    trusted_time_offset_s: PositiveFloat = 0.02
    """auto: standard deviation to which clocks agree, unless exactly, where nothing is wrong (exposure,
    rounded time stamps)."""
    frame_time_sigma_s: NonNegativeFloat = 0.0
    """Standard deviation of an error that all frame times share, beyond that; a converted video has one."""
    clock_rate: float = Field(default=0.0, gt=-0.1, lt=0.1)
    """Known rate of the clocks: the time offset grows by this in each second from the first frame on, such as
    0.001 where a video of 29.97 frames a second was taken for one of 30."""
    video_speed: PositiveFloat = 1.0
    """Known seconds that pass in a second of the video: 10 of a time-lapse, 0.25 of slow motion. At 1 another
    speed counts that the shape of the path shows beyond doubt."""
    significance_sigmas: PositiveFloat = 3.0
    """auto: a time offset is kept if it exceeds this many standard deviations."""
    time_offset: TimeOffsetConfig = TimeOffsetConfig()
    estimate_antenna: bool = False
    """Estimate the lever arm (camera_p_antenna) with the poses."""
    unknown_antenna_sigma_m: NonNegativeFloat = 0.1
    """Prior standard deviation of a lever arm that no rig gives, such as that of a camera's own receiver; it
    is then estimated about zero, and 0 holds it there."""
    separate_antenna_sigma_m: PositiveFloat = 1.0
    """The same of an antenna of its own, on a roof or a pole: of a receiver with fixes of RTK classes, or
    where the fixes contradict one at the camera."""
    antenna_sigma_m: PositiveFloat = 0.5
    """Prior standard deviation of the lever arm, on each axis."""

    @property
    def rate_is_given(self) -> bool:
        """Whether there is a rate of the clocks, or a speed of the video, whose rest is to be found."""
        return self.clock_rate != 0.0 or self.video_speed != 1.0

    @property
    def time_offset_prior_s(self) -> float:
        """Prior standard deviation of the rest of the time offset; 0 if it is not estimated."""
        return 0.0 if self.estimate_time_offset == "no" else self.time_offset_sigma_s

    @property
    def time_offset_reach_s(self) -> float:
        """How far from the configured time offset its rest is searched."""
        return self.time_offset.search_sigmas * self.time_offset_prior_s


class MotionConfig(SettingsModel):
    """Random accelerations of the camera, assumed only where frames have no features of their own."""

    rotation_density: PositiveFloat = Field(default=1.0, json_schema_extra={"unit": "rad/s^2/sqrt(Hz)"})
    """White noise of the angular acceleration."""
    translation_density: PositiveFloat = Field(default=2.0, json_schema_extra={"unit": "m/s^2/sqrt(Hz)"})
    """White noise of the acceleration."""


class BatchConfig(SettingsModel):
    """Stage D, Kume 2010: optimise everything once."""

    renamed: ClassVar[Mapping[str, str]] = {"balance_worth": "balance_prior_fixes"}
    basic: ClassVar[tuple[str, ...]] = ("video_sigma_scale", "robust_px")

    solver: Literal["schur", "gtsam"] = "schur"
    """Solver of stage D: the Schur complement of this package, or GTSAM's own (slower, same minimum)."""
    rounds: PositiveInt = 3
    """Rounds of optimisation; outliers are dropped and reliabilities (13) recomputed between them."""
    iterations: PositiveInt = 25
    """Steps of a round at most; the last round may take twice as many."""
    relative_tolerance: Share = 1e-5
    """The last round, and each window of stage C, ends once a step lowers the cost by a smaller share."""
    first_tolerance: float = Field(default=5.0, ge=1.0)
    """Factor on mapping.max_reprojection_px in the first round, while the poses are rough."""
    early_tolerance: Share = 3e-4
    """The rounds before the last end once a step lowers the cost by a smaller share."""
    robust_px: PositiveFloat = 1.0
    """Huber's constant: reprojection errors beyond it count linearly, before the weights of (12)."""
    weight: Literal["per_frame", "per_observation"] = "per_observation"
    """Weight of an observation: per_frame divides by the number of features in the frame, Eq. (12)."""
    video_sigma_scale: PositiveFloat = 8.0
    """Factor on all pixel sigmas: tracks drift together, so their errors are not independent."""
    balance: Literal["fixed", "estimated"] = "fixed"
    """Keep video_sigma_scale, or let it follow the misfit of the fixes from round to round."""
    balance_prior_fixes: PositiveFloat = 4.0
    """Weight of the prior belief that fixes fit as their regions say, as a number of independent fixes."""
    balance_range: float = Field(default=8.0, ge=1.0)
    """The estimated scale stays within this factor of video_sigma_scale, up or down."""
    held_share: Share = 0.02
    """Without GPS and control points, the scale is held by two frames this share of the path apart."""
    draws: PositiveInt = 200
    """Draws of all errors behind the poses' sigmas, which are known to 1 / sqrt(2 draws) of themselves."""


class IntrinsicsConfig(SettingsModel):
    """The camera's calibration, refined with the poses in stage D."""

    renamed: ClassVar[Mapping[str, str]] = {"steps": "iterations", "settled_sigmas": "tolerance_sigmas"}
    basic: ClassVar[tuple[str, ...]] = ("refine",)

    refine: Literal["auto", "yes", "no"] = "auto"
    """Refine the calibration with the poses: its errors bend the path. auto does from 20 frames on."""
    focal_sigma: Share = 0.01
    """Prior standard deviation of the focal length, as a share of it."""
    centre_sigma_px: PositiveFloat = 5.0
    """Prior standard deviation of the principal point, on each axis."""
    distortion_sigma: PositiveFloat = 0.02
    """Prior standard deviation of the first two distortion coefficients, where the lens model has any."""
    held_focal_sigma: Share = 0.005
    """Standard deviation of a held focal length, as a share of it; counts in the poses' sigmas."""
    held_centre_sigma_px: PositiveFloat = 3.0
    """Standard deviation of a held principal point, on each axis; counts in the poses' sigmas."""
    held_radial_sigma: PositiveFloat = 0.01
    """Standard deviation of the radial distortion k1 left after a held calibration; counts in the poses'
    sigmas."""
    iterations: PositiveInt = 8
    """Alternations between poses and calibration at most."""
    focal_changes: bool = True
    """Find changes of the focal length in a video, as by focus or zoom, where the calibration is refined; the
    run begins again with pictures scaled to one focal length."""
    every_frames: PositiveInt = 4
    """Without fixes, one in so many frames gives the calibration; tracks last several times as long."""
    tolerance_sigmas: PositiveFloat = 0.5
    """The alternation ends once every parameter changes by less than this share of its standard deviation."""

    @property
    def held_sigmas(self) -> FloatArray:
        """(4,) standard deviations of log focal length, principal point [px] and k1."""
        centre = [self.held_centre_sigma_px] * 2
        return np.array([self.held_focal_sigma, *centre, self.held_radial_sigma])
