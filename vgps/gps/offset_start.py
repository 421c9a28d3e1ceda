"""Initial values of the offsets of fixes: the likeliest walk, were the path right.

Their means alone keep the fixes' noise, which looks like jumps of the walk: from there Levenberg-Marquardt
takes more iterations.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.linalg import solveh_banded

from factors import Gaussian
from vgps.model import FloatArray, IntArray

_REWEIGHTINGS = 5  # they leave 2 to 3 % of the change from the means


def smoothed_offsets(
    error: FloatArray, offset: IntArray, noise: Sequence[Gaussian], walk: Mapping[int, Gaussian]
) -> FloatArray:
    """Return the offsets (K, 3) that noise and walk make likeliest, by iteratively reweighted least squares.

    Args:
        error: (M, 3) fix minus antenna, metres.
        offset: (M,) number of the offset of each, ascending from 0.
        noise: (M,) losses of the noise about the offsets.
        walk: Losses of the offsets' steps from the one before, by offset.
    """
    noise_m, noise_k = _scales(noise)
    walk_m, walk_k = _scales([walk[k] for k in sorted(walk)])
    later = np.array(sorted(walk), dtype=np.int64)
    count = int(offset[-1]) + 1
    offsets = _sums(offset, error, count) / np.bincount(offset)[:, None]
    for _ in range(_REWEIGHTINGS):
        of_noise = _weights(error - offsets[offset], noise_m, noise_k)
        of_walk = np.zeros((count, 3))
        of_walk[later] = _weights(offsets[later] - offsets[later - 1], walk_m, walk_k)
        diagonal = _sums(offset, of_noise, count) + of_walk
        diagonal[:-1] += of_walk[1:]
        right = _sums(offset, of_noise * error, count)
        for axis in range(3):
            bands = np.stack([-of_walk[:, axis], diagonal[:, axis]])[-min(count, 2) :]
            offsets[:, axis] = solveh_banded(bands, right[:, axis])
    return offsets


def _scales(losses: Sequence[Gaussian]) -> tuple[FloatArray, FloatArray]:
    """Return the sigmas (n, 3) and the constants (n,) of the losses."""
    sigma_m = np.array([loss.sigma_m for loss in losses]).reshape(-1, 3)
    return sigma_m, np.array([loss.cauchy_k or np.inf for loss in losses])


def _weights(residual: FloatArray, sigma_m: FloatArray, k: FloatArray) -> FloatArray:
    """Return the weights (n, 3) of Cauchy's loss on the length of residual / sigma."""
    squared = np.sum((residual / sigma_m) ** 2, axis=1)
    return np.asarray(1.0 / sigma_m**2 / (1.0 + squared / k**2)[:, None])


def _sums(offset: IntArray, values: FloatArray, count: int) -> FloatArray:
    """Return the sums (count, 3) of values (M, 3) by offset."""
    return np.stack([np.bincount(offset, values[:, axis], count) for axis in range(3)], axis=1)
