"""Settings of places that are seen again."""

from typing import ClassVar, Literal

from pydantic import Field, PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel
from vgps.config.quantities import Fraction, Share


class LoopsConfig(SettingsModel):
    """Places that the camera comes back to, found by appearance and tied together."""

    basic: ClassVar[tuple[str, ...]] = ("close",)

    close: Literal["auto", "no"] = "auto"
    """Tie a place that is seen again to what was seen there before, in stage D and live: auto where the path
    and its sigmas let the camera come back to a place, or never."""
    spacing: Share = 0.15
    """Frames that are compared lie this share of the depth of the scene apart."""
    reach: PositiveFloat = 0.5
    """Two frames may show the same if they are no further apart than this share of the depth, and what the
    sigmas of the path allow."""
    apart: PositiveFloat = 4.0
    """Frames belong to different visits if the path between them is longer than this many depths."""
    max_angle_deg: PositiveFloat = Field(default=45.0, lt=180.0)
    """Largest angle between the viewing directions of two frames that are compared."""
    path_sigmas: PositiveFloat = 4.0
    """A place may be off by this many standard deviations of the path; further off it is a look-alike."""
    slack: Share = 0.1
    """A place may be off by this share of the depth even where the path counts as perfect."""
    candidates: PositiveInt = 4
    """Earlier frames that a frame is compared with at most: half of them the nearest, half the most alike."""
    features: PositiveInt = 1000
    """ORB features of a frame."""
    reach_px: PositiveFloat = 12.0
    """A feature is as deep as the nearest landmark, if it is this close."""
    ratio: Fraction = 0.8
    """Lowe's ratio: a descriptor matches if its distance is below this times that of the second best."""
    inlier_px: PositiveFloat = 4.0
    """Largest reprojection error of a matched feature."""
    min_inliers: PositiveInt = 25
    """Matched features, and then landmarks found in the frame, that must agree on its pose."""
    min_share: Share = 0.3
    """Share of the earlier frame's landmarks in view of a frame that must be found in it."""
    neighbours: PositiveInt = 2
    """A place counts only if this many of the places seen just before and after are off by the same."""
    neighbour_drift: Share = 0.03
    """Share of the path between such places by which they may be off differently."""
