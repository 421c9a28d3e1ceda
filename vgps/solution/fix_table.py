"""Verdicts on the fixes of a log."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from vgps.model import BoolArray, FloatArray


class Verdict(StrEnum):
    """Decision of the optimisation about a fix."""

    USED = "used"
    DOWN_CLASSED = "down-classed"  # used with the region of the class below its own
    REJECTED = "rejected"  # it contradicts the video and the other fixes
    NOT_USED = "not used"  # cannot contribute, for example outside the video


@dataclass(frozen=True, kw_only=True)
class FixTable:
    """Verdicts on the fixes of a log, in the same order.

    Attributes:
        world_p_fix: (M, 3) ENU metres (NaN where the fix has no position).
        residual_m: (M, 3) estimated antenna minus fix, east, north, up; NaN outside the video.
        r_m, h_m: (M,) its region: that of its class, or of the class below if it was down-classed.
        probability: (M,) that the error is that of its class; NaN where it was not assessed.
        verdict: (M,) the verdict.
        reason: (M,) its reason, as a sentence.
    """

    world_p_fix: FloatArray
    residual_m: FloatArray
    r_m: FloatArray
    h_m: FloatArray
    probability: FloatArray
    verdict: tuple[Verdict, ...]
    reason: tuple[str, ...]

    @property
    def used(self) -> BoolArray:
        """(M,) whether a fix contributed to the final estimate."""
        return np.array([verdict in {Verdict.USED, Verdict.DOWN_CLASSED} for verdict in self.verdict], bool)

    @property
    def region_ratios(self) -> tuple[FloatArray, FloatArray]:
        """(M,) horizontal residual over r and (M,) vertical one over h, Eq. (16), Kume 2010."""
        with np.errstate(divide="ignore", invalid="ignore"):
            horizontal = np.hypot(self.residual_m[:, 0], self.residual_m[:, 1]) / self.r_m
            return horizontal, np.abs(self.residual_m[:, 2]) / self.h_m
