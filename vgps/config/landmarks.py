"""What goes into a landmark database, and which of it suits a camera."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel

Frames = Literal["all", "even", "odd"]
"""Which frames give templates and keyframes; the landmarks' positions are those of the whole run."""


class LandmarksConfig(SettingsModel):
    """Which landmarks, views and keyframes of a run go into a database."""

    renamed: ClassVar[Mapping[str, str]] = {"min_sightings": "min_observations"}

    patch_px: Literal[7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31] = 15
    """Side of a template, odd, so that its middle is a pixel."""
    levels: PositiveInt = Field(default=3, le=6)
    """Scales of a template; each covers twice the width of the one before."""
    max_views: PositiveInt = 8
    """Places from which a landmark is kept, spread in direction and distance."""
    min_observations: PositiveInt = 4
    """Landmarks seen in fewer frames are left out."""
    max_sigma_px: PositiveFloat = 1.0
    """Landmarks with a larger reliability sigma_j, Eq. (13) Kume 2010, are left out."""
    max_relative_sigma: PositiveFloat = 0.1
    """Landmarks whose position is uncertain by more than this share of their depth are left out."""
    max_error_px: PositiveFloat = 3.0
    """Observations that miss their landmark's projection by more give no view."""
    angle_unit_deg: PositiveFloat = 10.0
    """Views of a landmark are spread: so far apart in direction counts as one,"""
    octave_unit: PositiveFloat = 0.5
    """and so many doublings of its size in the image as much."""
    least_difference: NonNegativeFloat = 0.1
    """A view that differs from another by no more than this count is not kept."""
    keyframe_every: PositiveInt = 10
    """A keyframe for re-initialisation every so many frames of the video."""
    keyframe_reach_px: PositiveFloat = 4.0
    """A keyframe's feature this near to a landmark stands for it."""
    thumbnail_px: PositiveInt = 64
    """Width of a keyframe's thumbnail."""


class SelectionConfig(SettingsModel):
    """Which views of a landmark suit a camera."""

    max_view_angle_deg: PositiveFloat = 45.0
    """A view is of use while the landmark is seen within this angle of the direction that it shows."""
    max_tilt_deg: PositiveFloat = 75.0
    """And while the direction to the camera is within this angle of the template's normal."""
    nearer_octaves: NonNegativeFloat = 0.7
    """And while the camera sees the landmark at most 2**this times larger than the view does,"""
    further_octaves: NonNegativeFloat = 0.7
    """or 2**this times smaller; what was seen from much nearer may be hidden from afar."""
    angle_unit_deg: PositiveFloat = 10.0
    """The best view is nearest in direction, in this unit,"""
    octave_unit: PositiveFloat = 0.5
    """and in scale, in this one."""
    region_m: PositiveFloat = 4.0
    """What may be of use is looked up anew when the camera has gone so far."""
    cache_mb: PositiveInt = 256
    """Memory for the templates that were read last."""
