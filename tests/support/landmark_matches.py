"""Matches of landmarks by a global shutter."""

import numpy as np

from vgps.localization.pose import LandmarkMatches


def matched(landmark, points, uv_px, sigma_px):
    """Matches of landmarks (N,) at points (N, 3) and pixels (N, 2), with standard deviations (N,)."""
    return LandmarkMatches(
        landmark=landmark,
        world_p_landmark=points,
        uv_px=uv_px,
        sigma_px=sigma_px,
        shift_px=np.zeros_like(uv_px),
    )
