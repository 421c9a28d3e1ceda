"""How well fixes determine scale, heading and tilt of a map: when it may be placed in the world."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import StartConfig
from vgps.geometry import travelled
from vgps.mapping.map_update import Similarity
from vgps.model import FloatArray, IntArray
from vgps.smoothing.alignment.similarity import Correspondences, align, covariance, linearise

_BLOCKS = 5  # of the path, each left out once
_UNKNOWN_SCALE, _UNKNOWN_RAD = 1.0, np.radians(60.0)  # beyond which a linear sigma says nothing more


@dataclass(frozen=True)
class AlignmentSigmas:
    """Standard deviations of an alignment.

    Attributes:
        scale: Of the log scale: 0.05 is 5 %.
        heading_rad: Of the rotation about the vertical.
        tilt_rad: Of the rotation about the less certain horizontal axis.
    """

    scale: float
    heading_rad: float
    tilt_rad: float

    def within(self, config: StartConfig, factor: float = 1.0) -> bool:
        """Return whether scale and heading are known to the limits of the settings, times a factor."""
        limit_rad = float(np.radians(config.heading_sigma_deg))
        return self.scale <= factor * config.scale_sigma and self.heading_rad <= factor * limit_rad

    def __str__(self) -> str:
        scale = f"{self.scale:.0%}" if self.scale < _UNKNOWN_SCALE else "unknown"
        heading, tilt = (
            f"{np.degrees(sigma):.0f} degrees" if sigma < _UNKNOWN_RAD else "unknown"
            for sigma in (self.heading_rad, self.tilt_rad)
        )
        return f"scale {scale}, heading {heading}, tilt {tilt}"


def alignment_sigmas(
    seen: Correspondences, at: Similarity, errors: FloatArray, config: StartConfig
) -> AlignmentSigmas:
    """Return the standard deviations of an alignment by the errors of its fixes.

    Args:
        seen: Fixes and camera poses.
        at: The alignment.
        errors: (3, M, M) covariances of the fixes along east, north, up.
        config: The prior of a level camera.
    """
    all_of_them = covariance(linearise(seen, at, config), errors)
    scale, heading = np.sqrt(np.diagonal(all_of_them)[[0, 3]])
    tilt = np.sqrt(np.linalg.eigvalsh(all_of_them[1:3, 1:3])[-1])
    return AlignmentSigmas(float(scale), float(heading), float(tilt))


def antenna_covariances(seen: Correspondences, at: Similarity, sigma_m: float) -> FloatArray:
    """Return the covariances (3, M, M) of fixes along east, north, up by a lever arm that is not known.

    A camera that does not turn carries it along; one that turns swings the antenna about itself.

    Args:
        seen: Fixes and camera poses.
        at: Their alignment.
        sigma_m: Standard deviation of the lever arm on each axis.
    """
    axes = at.world_R_map @ seen.map_T_camera[:, :3, :3]
    return np.asarray(sigma_m**2 * np.einsum("iac,jac->aij", axes, axes))


def bending_covariances(seen: Correspondences, at: Similarity, turned: FloatArray) -> FloatArray:
    """Return the covariances (3, M, M) along east, north, up of the path at the fixes, as the video bends it.

    Its rotation walks at random, and each step is turned by what the walk is then. A path that climbs bends
    aside by more than it moves there, and so shows no heading.

    Args:
        seen: Fixes and camera poses.
        at: Their alignment.
        turned: (M,) variance of the walk from the first fix to each, rad^2 about each axis.
    """
    step = np.diff(at.points(seen.map_T_camera[:, :3, 3]), axis=0)
    walk = np.minimum.outer(turned[1:], turned[1:])
    out = np.zeros((3, len(seen), len(seen)))
    for axis, others in enumerate(((1, 2), (0, 2), (0, 1))):
        turns = walk * (step[:, others] @ step[:, others].T)
        out[axis, 1:, 1:] = np.cumsum(np.cumsum(turns, axis=0), axis=1)
    return out


def jackknife_sigmas(seen: Correspondences, at: Similarity, config: StartConfig) -> AlignmentSigmas:
    """Return the standard deviations by leaving out each part of the path in turn (Tukey's jackknife).

    They show what no model of the fixes' errors knows: outliers that an alignment hangs on, and a map that is
    bent. A stop is in one part, however long; infinite with fewer than three parts.
    """
    block = _blocks(seen.map_T_camera[:, :3, 3])
    names = np.unique(block)
    changes = np.full((len(names), 4), np.inf)
    for row, name in enumerate(names.tolist()):
        rest = seen.where(block != name)
        found = align(rest, config) if len(rest) > 1 else None
        if found is not None:
            rotation = Rotation.from_matrix(found.world_R_map @ at.world_R_map.T).as_rotvec()
            changes[row] = np.log(found.scale / at.scale), *rotation
    if len(names) < 3:
        changes[:] = np.inf
    sigma = np.sqrt((len(names) - 1) / len(names) * np.sum(changes**2, axis=0))
    return AlignmentSigmas(float(sigma[0]), float(sigma[3]), float(np.hypot(sigma[1], sigma[2])))


def _blocks(centres: FloatArray) -> IntArray:
    """Return the part (M,) of the path that each of its points (M, 3) is in, by distance along it."""
    along = travelled(centres)
    return np.minimum(_BLOCKS * along / max(float(along[-1]), 1e-12), _BLOCKS - 1).astype(np.int64)
