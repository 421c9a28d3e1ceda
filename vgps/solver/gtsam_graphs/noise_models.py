"""Sigma and robust loss of a GTSAM noise model, read out as numbers."""

from typing import NamedTuple

import gtsam
import numpy as np
from gtsam.noiseModel import mEstimator

from vgps.model import FloatArray
from vgps.solver.problem import RobustLoss

_WEIGHT_TOLERANCE = 1e-9  # relative, between GTSAM's weights and those by sigma and k


class PixelNoise(NamedTuple):
    """Sigma of both pixel coordinates; loss of the whitened error and its constant, inf for no loss."""

    sigma_px: float
    loss: RobustLoss
    k: float


def read_noise_model(model: gtsam.noiseModel.Base) -> PixelNoise | None:
    """Read sigma and loss of a noise model for two pixel coordinates.

    GTSAM does not expose the constant of a loss, so it is derived from a weight. GTSAM's weights of
    small and large errors must then equal those by sigma and the constant.

    Returns:
        None if the coordinates have unequal sigmas or are correlated, or the loss is neither Huber's nor
        Cauchy's.
    """
    robust = model if isinstance(model, gtsam.noiseModel.Robust) else None
    inner = model if robust is None else robust.noise()
    if not isinstance(inner, gtsam.noiseModel.Diagonal) or inner.isConstrained():
        return None
    sigmas = np.asarray(inner.sigmas())
    if sigmas.shape != (2,) or sigmas[0] != sigmas[1]:
        return None
    sigma = float(sigmas[0])
    if robust is None:
        return PixelNoise(sigma, "none", np.inf)
    loss = robust.robust()
    if isinstance(loss, mEstimator.Huber):
        noise = PixelNoise(sigma, "huber", loss.weight(1e9) * 1e9)
    elif isinstance(loss, mEstimator.Cauchy):
        noise = PixelNoise(sigma, "cauchy", _cauchy_constant(loss))
    else:
        return None
    return noise if _same_weights(model, noise) else None


def _cauchy_constant(loss: mEstimator.Cauchy) -> float:
    """Return k of ``weight(e) = k^2 / (k^2 + e^2)``, which is one half at e = k."""
    k = 1.0
    for _ in range(3):
        weight = loss.weight(k)
        k *= np.sqrt(weight / max(1.0 - weight, 1e-300))
    return float(k)


def _same_weights(model: gtsam.noiseModel.Base, noise: PixelNoise) -> bool:
    """Return whether GTSAM weighs errors as ``noise`` does; a loss on each coordinate alone would not."""
    for size in (0.3, 0.9, 1.1, 3.0, 100.0):
        error: FloatArray = noise.k * noise.sigma_px * size * np.array([0.28, -0.96])
        weight = min(1.0, 1.0 / size) if noise.loss == "huber" else 1.0 / (1.0 + size**2)
        expected = np.sqrt(weight) * error / noise.sigma_px
        if not np.allclose(model.whiten(error), expected, rtol=_WEIGHT_TOLERANCE, atol=0.0):
            return False
    return True
