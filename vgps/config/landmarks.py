"""What goes into a landmark database, and which of it suits a camera."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel

Frames = Literal["all", "even", "odd"]
"""Which frames give templates and keyframes; the landmarks' positions are those of the whole run."""


class LandmarksConfig(SettingsModel):
    """Which landmarks, views and keyframes of a run go into a database."""

    renamed: ClassVar[Mapping[str, str]] = {
        "min_sightings": "min_observations",
        "least_difference": "min_view_difference",
    }
    basic: ClassVar[tuple[str, ...]] = ("max_views", "min_observations", "max_sigma_px")

    patch_px: Literal[7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31] = 15
    """Side of a template, odd so that its centre is a pixel."""
    levels: PositiveInt = Field(default=3, le=6)
    """Scales of a template; each covers twice the width of the one before."""
    max_views: PositiveInt = 8
    """Views kept of a landmark at most, spread in direction and scale."""
    min_observations: PositiveInt = 4
    """Landmarks observed in fewer frames are left out."""
    max_sigma_px: PositiveFloat = 1.0
    """Landmarks with a larger reliability sigma_j, Eq. (13) Kume 2010, are left out."""
    max_relative_sigma: PositiveFloat = 0.1
    """Landmarks whose position has a sigma above this times their smallest depth are left out."""
    max_error_px: PositiveFloat = 3.0
    """Observations with a larger reprojection error give no view."""
    angle_unit_deg: PositiveFloat = Field(default=10.0, le=180.0)
    """Difference in direction between two views that counts as one unit when views are spread."""
    octave_unit: PositiveFloat = 0.5
    """Difference in scale between two views, in doublings, that counts as one unit."""
    error_unit_px: PositiveFloat = 1.0
    """Reprojection error that halves the difference by which a view is chosen."""
    min_view_difference: NonNegativeFloat = 0.1
    """A view that differs from a chosen one by no more than this, in these units, is not kept."""
    keyframe_every: PositiveInt = 10
    """Frames from one keyframe, by which a lost camera is found again, to the next."""
    keyframe_features: PositiveInt = 4000
    """Features of a keyframe at most; those near no landmark are dropped."""
    keyframe_reach_px: PositiveFloat = 4.0
    """A keyframe's feature belongs to a landmark if it is this close to the landmark's observation."""
    thumbnail_px: PositiveInt = 64
    """Width of a keyframe's thumbnail."""


class SelectionConfig(SettingsModel):
    """Which views of a landmark suit a camera."""

    max_view_angle_deg: PositiveFloat = Field(default=45.0, le=180.0)
    """A view suits if the camera looks at the landmark within this angle of the view's own direction."""
    max_tilt_deg: PositiveFloat = Field(default=75.0, le=90.0)
    """A view suits if the direction to the camera lies within this angle of the template's normal."""
    nearer_octaves: NonNegativeFloat = 0.7
    """A view suits if the camera sees the landmark at most 2**this times larger than the view does."""
    further_octaves: NonNegativeFloat = 0.7
    """A view suits if the camera sees it at most 2**this times smaller; from afar it may be hidden."""
    angle_unit_deg: PositiveFloat = Field(default=10.0, le=180.0)
    """Difference in direction that counts as one unit when the best view is chosen."""
    octave_unit: PositiveFloat = 0.5
    """Difference in scale, in doublings, that counts as one unit."""
    region_m: PositiveFloat = 4.0
    """Landmarks that may be visible are looked up anew once the camera has moved this far."""
    cache_mb: PositiveInt = 256
    """Memory for the templates read last."""
