"""Standard deviations of a live pose: of the fusion, and of the motion since features were last seen."""

from dataclasses import dataclass

import numpy as np

from vgps.config import MotionConfig
from vgps.model import FloatArray
from vgps.online.fusion.fusion_equations import POSITION, ROTATION


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations (3,) of a pose: position along, and rotation about, east, north, up."""

    position_m: FloatArray
    rotation_rad: FloatArray


UNKNOWN_SIGMAS = Sigmas(np.full(3, np.nan), np.full(3, np.nan))


def pose_sigmas(covariance: FloatArray, away_s: float, motion: MotionConfig) -> Sigmas:
    """Return the standard deviations of a pose.

    Args:
        covariance: (7, 7) of position, log scale and rotation at the last frame with features.
        away_s: Time since that frame.
        motion: Random accelerations in this time.
    """
    variance, grown = np.diagonal(covariance), away_s**3 / 3.0
    return Sigmas(
        np.sqrt(variance[POSITION] + motion.translation_density**2 * grown),
        np.sqrt(variance[ROTATION] + motion.rotation_density**2 * grown),
    )
