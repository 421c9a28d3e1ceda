"""Fixes that the live path before them contradicts, though verdicts believe them.

After some seconds without RTK-fixes the verdict on one hangs on how far the video may have drifted, for which
verdicts allow more than the fit of the live path expects (:mod:`vgps.gps.drift_model`). Where a wrong fix
explains as well how far the path moved, either may be right. The poses follow the fixes, and their standard
deviations cover the other case for as long as a receiver may take to find out.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from vgps.config import Config, OutlierConfig
from vgps.gps.fix_conflict import WRONG_LASTS_S
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.fix_states import log_outlier_density
from vgps.gps.fixes import Fixes
from vgps.model import FloatArray
from vgps.online.fusion.path_fusion import FusedPath
from vgps.online.fusion.video_path import VideoPath

_LIKELIER = 0.5  # than that they are right
_BACK = 0.75  # of the way that they moved the path


@dataclass(frozen=True)
class Doubt:
    """Fixes that moved the path farther than it can have been wrong.

    Attributes:
        since_s: Time of the pose that they moved.
        moved_m: (3,) by how much.
        probability: That they are wrong.
    """

    since_s: float
    moved_m: FloatArray
    probability: float

    @property
    def note(self) -> str:
        """What the user should know of it."""
        return (
            f"fixes that came by {self.since_s:.1f} s lie {np.linalg.norm(self.moved_m):.1f} m off the path "
            f"before, by which they are wrong with p = {self.probability:.3g}; their verdicts say otherwise: "
            "the poses follow them, and the standard deviations cover both"
        )

    def outweighs(self, before: "Doubt") -> bool:
        """Return whether an earlier doubt leaves less unsure by now."""
        return bool(np.trace(self.covariance(self.since_s)) > np.trace(before.covariance(self.since_s)))

    def takes_back(self, before: "Doubt") -> bool:
        """Return whether these fixes lead back to where the path was without those doubted before."""
        back_m2 = -float(self.moved_m @ before.moved_m)
        return self.probability > _LIKELIER and back_m2 > _BACK * float(before.moved_m @ before.moved_m)

    def covariance(self, t_s: float) -> FloatArray:
        """Return what a position at a time is unsure of for this reason, (3, 3)."""
        if t_s < self.since_s:
            return np.zeros((3, 3))
        lasting = self.probability * np.exp((self.since_s - t_s) / WRONG_LASTS_S)
        return np.asarray(lasting * np.outer(self.moved_m, self.moved_m))


def doubt_about(
    fixes: Fixes, before: FusedPath, now: FusedPath, path: VideoPath, config: Config
) -> Doubt | None:
    """Return the doubt about new fixes; None if they are no likelier wrong than before the path was asked.

    Args:
        fixes: Those that the fit before did not know, with their verdicts.
        before, now: The fits before and with them.
        path: The video's.
        config: How likely fixes are wrong, and the drift.
    """
    moved_m = now.moved_from(before, path)
    known_m2 = before.antenna_covariance_at_end(path, config)
    probability = wrong_probability(fixes, moved_m, known_m2, config.outliers)
    if probability <= config.outliers.outlier_share + config.outliers.lower_share:
        return None
    return Doubt(float(path.t_s[-1]), moved_m, probability)


def wrong_probability(
    fixes: Fixes, moved_m: FloatArray, known_m2: FloatArray, config: OutlierConfig
) -> float:
    """Return the probability that fixes are wrong by which a position moved; 0 if there are none.

    They are outliers then, or RTK-fixes with the error of the class below.

    Args:
        fixes: With their verdicts.
        moved_m: (3,) movement of the position.
        known_m2: (3, 3) its covariance before.
        config: How likely fixes are wrong.
    """
    fixes = fixes.where(fixes.used)
    if not len(fixes):
        return 0.0

    def log_density(size_m: FloatArray) -> float:
        covariance_m2 = known_m2 + np.diag(size_m**2)
        squared = moved_m @ np.linalg.solve(covariance_m2, moved_m)
        return -0.5 * float(squared + np.linalg.slogdet(2.0 * np.pi * covariance_m2)[1])

    lower, outlier = 0.0, config.outlier_share
    # a Gaussian as dense in the middle, since the path may be as far off itself
    outlier_m = np.full(3, np.exp(-log_outlier_density(config) / 3.0) / np.sqrt(2.0 * np.pi))
    wrong = np.log(outlier) + log_density(outlier_m)
    fallible = fixes.where(np.isfinite(fixes.lower_r_m) & ~fixes.down_classed)
    if len(fallible):
        lower = config.lower_share
        size_m = region_sigmas(replace(fallible, r_m=fallible.lower_r_m, h_m=fallible.lower_h_m))[-1]
        wrong = np.logaddexp(wrong, np.log(lower) + log_density(size_m))
    return float(expit(wrong - np.log(1.0 - lower - outlier) - log_density(np.zeros(3))))
