"""Fixes of one stretch that contradict each other: which of them count as wrong, and how sure that is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from vgps.config import OutlierConfig
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment
from vgps.model import BoolArray, FloatArray, IntArray

WRONG_LASTS_S = 30.0  # assumed: the time in which a receiver finds out that its integers are wrong


@dataclass(frozen=True, kw_only=True)
class FixConflict:
    """Fixes that are wrong if others of their stretch are right.

    Attributes:
        right: Rows of the fixes compared that are right; those near them are as likely as without a conflict.
        wrong: (k,) rows of those that are wrong.
        wrong_s: Times of the first and the last of these.
        error_m: (k, 3) their errors, ENU; NaN where the error may have begun before or after the fix.
        otherwise_m: (3,) by how much the path would move if the likeliest others were right.
        probability: That they are, at most 0.5.
        frames: First and last frame that hang on these fixes.
    """

    right: IntArray
    wrong: IntArray
    wrong_s: tuple[float, float]
    error_m: FloatArray
    otherwise_m: FloatArray
    probability: float
    frames: tuple[int, int]

    @property
    def note(self) -> str:
        """What the user should know of it."""
        east, north, up = self.error_m.T
        plane, height = np.nanmedian(np.hypot(east, north)), np.nanmedian(np.abs(up))
        begin_s, end_s = self.wrong_s
        return (
            "RTK-fixes contradict each other, as the video sees the path between them: "
            f"{len(self.wrong)} from {begin_s:.1f} to {end_s:.1f} s lie {plane:.2f} m in the plane and "
            f"{height:.2f} m in height off the others near them, and count as wrong; with p = "
            f"{self.probability:.2g} it is the other way round, which the standard deviations cover"
        )


@dataclass(frozen=True)
class Sides:
    """The runs (K,) that are right, those (K,) of the likeliest alternative, and its probability."""

    right: BoolArray
    other: BoolArray
    probability: float


def sides(alike: BoolArray, fixes: IntArray, interval_s: float, config: OutlierConfig) -> Sides | None:
    """Return which runs of fixes are right where their errors differ; None if they do not.

    What holds longer is more likely to be right, and what leaves fewer wrong runs, or single wrong fixes.

    Args:
        alike: (K, K) which runs, in order of time, have the same error.
        fixes: (K,) their numbers of fixes.
        interval_s: Between these.
        config: How often an error begins, and whether it lasts to the next fix.
    """
    begins = np.log(config.lower_share) + np.where(fixes > 1, np.log(config.persistence), 0.0)
    score = alike @ (fixes * interval_s / WRONG_LASTS_S) + ~alike @ begins
    best = int(np.argmax(score))
    if alike[best].all():
        return None
    other = int(np.argmax(np.where(alike[best], -np.inf, score)))
    return Sides(alike[best], alike[other], float(expit(score[other] - score[best])))


def with_conflict_verdicts(
    assessment: FixAssessment, conflicts: Sequence[FixConflict], fixes: Fixes
) -> FixAssessment:
    """Return the assessment (M,) with the verdicts of conflicts.

    Wrong fixes get the class below if it explains their error; what was rejected and is not right stays so.
    """
    nominal, lower = assessment.nominal.copy(), assessment.lower.copy()
    for one in conflicts:
        nominal[one.right], lower[one.right] = 1.0 - one.probability, one.probability
        within = np.hypot(*one.error_m.T[:2]) <= fixes.lower_r_m[one.wrong]
        within &= np.abs(one.error_m[:, 2]) <= fixes.lower_h_m[one.wrong]
        probability = min(one.probability, 0.499)  # a tie has a verdict, too
        nominal[one.wrong] = probability
        within &= ~assessment.rejected[one.wrong]
        lower[one.wrong] = np.where(within, 1.0 - probability, 0.0)
    return FixAssessment(nominal, lower)
