"""Settings of stages A and B, and of the start of a map."""

from typing import Literal

from pydantic import PositiveFloat, PositiveInt

from vgps.config.base import SettingsModel


class TrackingConfig(SettingsModel):
    """Stage A, Kume 2010: follow features from frame to frame and pose the camera by them."""

    method: Literal["lk", "ssd"] = "lk"
    """Matcher: pyramidal Lucas-Kanade, or the thesis's SSD templates on Harris corners."""
    max_features: PositiveInt = 350
    """Corners are added while fewer features than this are being followed."""
    min_distance_px: PositiveFloat = 12.0
    """No new corner nearer than this to a followed one."""
    harris_k: float = 0.04
    harris_quality: PositiveFloat = 1e-4
    """A corner's Harris response must exceed this share of the strongest in the frame (A-1)."""
    window_px: PositiveInt = 15
    """Side of the patch that is matched."""
    pyramid_levels: PositiveInt = 4
    search_px: PositiveInt = 48
    """SSD: half side of the search window around the previous position (A-2)."""
    rematch_px: PositiveInt = 6
    """SSD: half side of the search window around the predicted position (A-4)."""
    max_match_error: PositiveFloat = 25.0
    """A match is refused when its mean absolute grey difference exceeds this."""
    forward_backward_px: PositiveFloat = 1.0
    """LK: a match is refused when tracking it back misses its start by more."""
    lmeds_samples: PositiveInt = 60
    """Minimal samples drawn for the least-median-of-squares pose (A-3)."""
    inlier_px: PositiveFloat = 2.5
    """Reprojection error above which a match does not vote in (A-5)."""
    min_inliers: PositiveInt = 12
    """Fewer inliers than this and the frame counts as lost."""
    min_inlier_share: PositiveFloat = 0.3
    """A smaller share of inliers and the frame counts as lost."""
    static_px: PositiveFloat = 0.4
    """A frame whose features moved by less (median) since the last view adds no view: the camera stands."""


class MappingConfig(SettingsModel):
    """Stage B, Kume 2010: triangulate (19), add and delete features by their quality."""

    min_parallax_deg: PositiveFloat = 0.2
    """A feature gets a position once the largest angle between its rays exceeds this."""
    max_reprojection_px: PositiveFloat = 2.0
    """A position is accepted when every view of the feature agrees to this; a match beyond it is dropped."""
    max_sigma_px: PositiveFloat = 1.5
    """A feature whose reliability sigma_j (13) is larger is deleted."""
    sigma_floor_px: PositiveFloat = 0.3
    """Two or three views drive sigma_j to zero; it is never taken smaller than this."""
    max_track_frames: PositiveInt = 60
    """A feature followed for longer goes on as a new one (the solver's cost grows with the square)."""
    min_views: PositiveInt = 3
    """Features seen in fewer frames are left out of the graph."""


class StartConfig(SettingsModel):
    """How a map begins and how it finds its place in the world."""

    min_flow_px: PositiveFloat = 15.0
    """Median image motion between the two views that begin a map."""
    min_inliers: PositiveInt = 30
    """Features that agree with the two views' essential matrix and lie in front of both cameras."""
    min_parallax_deg: PositiveFloat = 0.7
    """Median angle between the rays of the two views."""
    min_fixes: PositiveInt = 3
    """Usable fixes before scale, heading and position are taken from GPS."""
    min_travel_ratio: PositiveFloat = 4.0
    """The fixes must span this many times the median region radius before they give scale and heading."""
    min_travel_m: PositiveFloat = 3.0
    least_travel_ratio: PositiveFloat = 1.0
    """At the end of a video that never spans enough this many must do, and the result is said to be poor."""
    level_sigma_deg: PositiveFloat = 5.0
    """The camera is believed to be carried upright to this standard deviation of its mean roll. It matters
    only where the fixes do not show the roll, on a straight track above all."""
    min_control_travel_m: PositiveFloat = 0.5
    """Frames posed by control points must lie this far apart before they give the scale."""
    control_sigma_px: PositiveFloat = 1.0
    """Standard deviation of a control point's observation."""
    pitch_sigma_deg: PositiveFloat = 30.0
    """The same for its mean pitch."""
