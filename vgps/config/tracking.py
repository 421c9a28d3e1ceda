"""Settings of stages A and B, and of the start of a map."""

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.config.quantities import Fraction, Share
from vgps.model import FloatArray

_ANY_PITCH_DEG = 60.0  # standard deviation of the pitch of a camera that looks ahead or straight down


class TrackingConfig(SettingsModel):
    """Stage A, Kume 2010: follow features from frame to frame and pose the camera by them."""

    basic: ClassVar[tuple[str, ...]] = ("method", "max_features")

    method: Literal["lk", "ssd"] = "lk"
    """Feature matcher: pyramidal Lucas-Kanade, or SSD templates on Harris corners as in the thesis."""
    max_features: PositiveInt = 350
    """Features followed from frame to frame at most."""
    refill_share: Share = 0.75
    """New corners are added once fewer than this share of max_features is followed."""
    min_distance_px: PositiveFloat = 12.0
    """Side of the grid cells in which new corners start: one per cell, where no feature is followed."""
    harris_k: float = Field(default=0.04, gt=0.0, lt=0.25)
    """Harris's constant k in det(M) - k trace(M)^2, the response of a corner (A-1)."""
    harris_quality: Fraction = 1e-4
    """A corner is accepted if its Harris response exceeds this fraction of the frame's strongest (A-1)."""
    window_px: PositiveInt = 15
    """Side of the patch that is matched, for both matchers."""
    pyramid_levels: PositiveInt = 4
    """Levels of the image pyramid of Lucas-Kanade; each halves the resolution of the one before."""
    first_levels: PositiveInt = 2
    """LK: levels of the first try, around predictions that are off by a few pixels at most."""
    first_share: Share = 0.75
    """LK: features not found at the first try are searched in the whole pyramid if fewer were found."""
    search_px: PositiveInt = 48
    """SSD: half the side of the search window around a feature's previous position (A-2)."""
    rematch_px: PositiveInt = 2
    """A feature is lost if its reference patch fits only further than this from where it is expected
    (A-4)."""
    return_frames: NonNegativeInt = 120
    """Features that left the picture go on when the camera looks back before their reference patches are
    this old; 0 for never."""
    min_returning: PositiveInt = 30
    """Features that left the picture come back together, in no smaller number: fewer hardly tie the frames of
    both times."""
    max_match_error: PositiveFloat = 25.0
    """A match is rejected if its mean absolute difference in grey values (0 to 255) exceeds this."""
    forward_backward_px: PositiveFloat = 1.0
    """LK: a match is rejected if tracking it back to the previous frame misses its start by more."""
    lmeds_samples: PositiveInt = 60
    """Minimal samples drawn for the least-median-of-squares pose (A-3)."""
    inlier_px: PositiveFloat = 2.5
    """A match with a larger reprojection error is an outlier of the frame's pose (A-5)."""
    min_inliers: PositiveInt = 12
    """A frame with fewer inliers is lost; half as many suffice if a gyro gives its rotation. In stage D an
    IMU holds frames with fewer."""
    min_inlier_share: Share = 0.3
    """A frame with a smaller share of inliers among its matches is lost."""
    static_px: PositiveFloat = 0.4
    """A frame adds no view if the median feature moved by less since the last view: the camera stands
    still."""
    recovery_features: PositiveInt = 1500
    """Features of a frame at most by which a camera that was lost is found again."""
    recovery_ratio: Fraction = 0.8
    """Lowe's ratio: a descriptor matches if its distance is below this times that of the second best."""


class MappingConfig(SettingsModel):
    """Stage B, Kume 2010: triangulate features (19), add and delete them by their quality."""

    min_parallax_deg: PositiveFloat = Field(default=0.2, lt=180.0)
    """A feature is triangulated once the largest angle between its rays exceeds this."""
    max_reprojection_px: PositiveFloat = 2.0
    """A triangulated position is accepted if every view agrees to this; a later match beyond it is
    dropped."""
    max_sigma_px: PositiveFloat = 1.5
    """A feature is deleted if its reliability sigma_j (13) is larger."""
    sigma_floor_px: PositiveFloat = 0.3
    """Lower bound of sigma_j, which two or three views would drive to zero."""
    refine_every: PositiveInt = 5
    """Views from one triangulation of a feature to the next, once it has a position."""
    max_track_frames: PositiveInt = 60
    """A feature followed for longer goes on as a new one; the solver's cost grows with the square of this."""
    min_views: PositiveInt = 3
    """A feature observed in fewer frames is left out of stages C and D."""
    edge_frames: PositiveInt = 5
    """Frames at the end of a map whose motion places the next map where fixes do not."""


class StartConfig(SettingsModel):
    """How a map begins, and what gives it scale, heading and position."""

    removed: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("min_travel_m", "min_travel_ratio", "final_travel_ratio", "least_travel_ratio", "min_places"),
        "a map is placed in the world by start.scale_sigma and start.heading_sigma_deg",
    )
    basic: ClassVar[tuple[str, ...]] = (
        "scale_sigma",
        "heading_sigma_deg",
        "roll_deg",
        "level_sigma_deg",
        "pitch_sigma_deg",
    )

    min_flow_px: PositiveFloat = 15.0
    """Median image motion needed between the two views that begin a map."""
    max_error_px: PositiveFloat = 1.0
    """Features that fit the two views worse than this are outliers."""
    min_inliers: PositiveInt = 30
    """Features needed that agree with the essential matrix of the two views and lie in front of both."""
    min_parallax_deg: PositiveFloat = Field(default=0.7, lt=180.0)
    """Median angle needed between the rays of the two views."""
    max_chance: PositiveFloat = Field(default=0.0027, le=1.0)
    """Probability that two views which show no motion start a map of a camera that flies, that of three
    standard deviations: while it turns on the spot wrong matches show any motion. 1 asks for none, and lets
    no map wait for the parallax that shows its motion over a plane."""
    min_fixes: PositiveInt = 3
    """Usable fixes needed before GPS gives scale, heading and position."""
    scale_sigma: PositiveFloat = 0.05
    """A map is placed in the world once its scale is known to this share, one standard deviation."""
    heading_sigma_deg: PositiveFloat = 5.0
    """A map is placed in the world once its heading is known to this, one standard deviation."""
    roll_deg: float = 0.0
    """How far the camera is turned clockwise, as it looks: 180 for one that hangs upside down. Half a turn
    and quarter turns are found, too, where the path shows them."""
    level_sigma_deg: PositiveFloat = 5.0
    """Standard deviation of the camera's mean roll about ``roll_deg``, and of the tilt that a correction of
    drift gives a path; decides where nothing else shows the roll."""
    crossfall_sigma_deg: PositiveFloat = 1.5
    """Standard deviation of the ground's slope to the side, which shows stage D the roll of a camera that
    travels over a plane."""
    pitch_sigma_deg: PositiveFloat = 30.0
    """Standard deviation of the camera's mean pitch about level; of one that flies 60 degrees at least."""
    airborne: Literal["auto", "yes", "no"] = "auto"
    """Whether the camera flies: where the path does not show its tilt, the plane that it sees is the ground,
    and without one its pitch is unknown. Auto: if a recording's fixes are those of a DJI drone; live sources
    do not say."""
    land_sigma_deg: PositiveFloat = 10.0
    """Standard deviation of the slope of the land under a camera that flies."""
    robust_regions: PositiveFloat = 1.0
    """Cauchy's constant of the alignment with fixes, in regions: fixes further off count less and less."""
    min_control_travel_m: PositiveFloat = 0.5
    """Frames posed by control points must lie this far apart before they give the scale."""
    control_sigma_px: PositiveFloat = 1.0
    """Standard deviation of an observation of a control point."""

    @property
    def upright(self) -> FloatArray:
        """(3, 3) columns right, down and forward of the camera if it were not turned, in its own axes."""
        roll = np.radians(self.roll_deg)
        c, s = np.cos(roll), np.sin(roll)
        return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])

    @property
    def tilt_sigmas_deg(self) -> tuple[float, float]:
        """Standard deviations of roll and pitch about level."""
        pitch_deg = max(self.pitch_sigma_deg, _ANY_PITCH_DEG) if self.flies else self.pitch_sigma_deg
        return self.level_sigma_deg, pitch_deg

    @property
    def chance_of_start(self) -> float:
        """``max_chance`` of a camera that flies; in a room or street, where halves may show too little, 1."""
        return self.max_chance if self.flies else 1.0

    @property
    def flies(self) -> bool:
        """Whether the camera is taken to fly; auto is decided when a recording is opened to be posed."""
        return self.airborne == "yes"
