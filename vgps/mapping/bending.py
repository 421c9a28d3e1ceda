"""The bending of a map's path: by how much its rotation may err more at each frame than at the one before."""

import numpy as np

from vgps.model import FloatArray

_WINDOW_FRAMES = 30  # by the settings' defaults a stage C counts 26 frames after the one before


def continued(bending: FloatArray) -> FloatArray:
    """Return the bending (n,) of all frames: zero where it is NaN, but after the newest frame that stage C
    reached it goes on as it was there, for as long as the next one takes.
    """
    out, known = np.nan_to_num(bending), np.flatnonzero(np.isfinite(bending))
    if len(known):
        end = int(known[-1]) + 1
        out[end : end + _WINDOW_FRAMES] = out[max(end - _WINDOW_FRAMES, 0) : end].mean()
    return out
