"""The meaning of colours; RGBA, 0 to 255."""

import numpy as np
import numpy.typing as npt

from vgps.model import FixClass, FloatArray
from vgps.solution import Verdict

Colour = tuple[int, int, int, int]
Colours = npt.NDArray[np.uint8]

PATH: Colour = (40, 200, 255, 255)
BRIDGED: Colour = (255, 120, 0, 255)
BEFORE: Colour = (190, 150, 255, 255)
NOW: Colour = (255, 255, 255, 255)
POSE: Colour = (40, 200, 255, 255)
MOVING: Colour = (255, 150, 40, 255)
REJECTED: Colour = (255, 40, 40, 255)
DOWN_CLASSED: Colour = (255, 0, 220, 255)
NOT_USED: Colour = (130, 130, 130, 255)
CLASS: dict[FixClass, Colour] = {
    FixClass.RTK_FIX: (60, 220, 90, 255),
    FixClass.RTK_FLOAT: (250, 190, 40, 255),
    FixClass.PPP: (40, 200, 180, 255),
    FixClass.DGPS: (70, 130, 255, 255),
    FixClass.SBAS: (160, 110, 255, 255),
    FixClass.SINGLE: (230, 130, 170, 255),
    FixClass.UNKNOWN: (200, 200, 200, 255),
}
BAD_PX = 2.0
"""Reprojection error that is drawn red."""
GOOD_SIGMA_PX, BAD_SIGMA_PX = 0.3, 1.5
"""Reliability sigma_j, Eq. (13), Kume 2010, that is drawn green, and red."""
_SCALE = np.array([[60, 220, 90], [250, 220, 40], [255, 40, 40]], dtype=float)


def of_fix(fix_class: FixClass, verdict: Verdict) -> Colour:
    """Return the colour of a fix: of its class if it was used as such, otherwise of its verdict."""
    if verdict is Verdict.USED:
        return CLASS[fix_class]
    return {
        Verdict.DOWN_CLASSED: DOWN_CLASSED,
        Verdict.REJECTED: REJECTED,
        Verdict.NOT_USED: NOT_USED,
    }[verdict]


def green_to_red(values: FloatArray, good: float, bad: float) -> Colours:
    """Return (N, 3) colours: green at ``good`` over yellow to red from ``bad`` on, grey for NaN."""
    share = np.clip((values - good) / (bad - good), 0.0, 1.0)
    mixed = [np.interp(np.nan_to_num(share), [0.0, 0.5, 1.0], channel) for channel in _SCALE.T]
    known = np.isfinite(share)[:, None]
    return np.rint(np.where(known, np.stack(mixed, axis=-1), 128.0)).astype(np.uint8)
