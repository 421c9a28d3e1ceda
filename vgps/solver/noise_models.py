"""The noise model of a projection factor as numbers: sigma, and the robust loss around it."""

from typing import NamedTuple

import gtsam
import numpy as np
from gtsam.noiseModel import mEstimator

from vgps.model import FloatArray
from vgps.solver.problem import RobustLoss

_SAME = 1e-9  # relative, between what GTSAM weighs and what the numbers say


class Noise(NamedTuple):
    """Sigma of both coordinates; loss of the whitened error and its constant, inf if there is none."""

    sigma_px: float
    loss: RobustLoss
    k: float


def read_noise(model: gtsam.noiseModel.Base) -> Noise | None:
    """Sigma and loss of a noise model for two pixel coordinates.

    GTSAM does not tell the constant of a loss: it is found from a weight, and the model is then asked to
    weigh errors small and large, whose answers must be those of the numbers.

    Returns:
        Nothing where the coordinates differ or hang together, or the loss is not Huber's or Cauchy's.
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
        return Noise(sigma, "none", np.inf)
    loss = robust.robust()
    if isinstance(loss, mEstimator.Huber):
        noise = Noise(sigma, "huber", loss.weight(1e9) * 1e9)
    elif isinstance(loss, mEstimator.Cauchy):
        noise = Noise(sigma, "cauchy", _cauchy_constant(loss))
    else:
        return None
    return noise if _weighs_like(model, noise) else None


def _cauchy_constant(loss: mEstimator.Cauchy) -> float:
    """From ``weight(e) = k^2 / (k^2 + e^2)``, read where it is one half."""
    k = 1.0
    for _ in range(3):
        weight = loss.weight(k)
        k *= np.sqrt(weight / max(1.0 - weight, 1e-300))
    return float(k)


def _weighs_like(model: gtsam.noiseModel.Base, noise: Noise) -> bool:
    """Also tells the weighting of each coordinate by itself, which GTSAM offers and the engine does not."""
    for size in (0.3, 0.9, 1.1, 3.0, 100.0):
        error: FloatArray = noise.k * noise.sigma_px * size * np.array([0.28, -0.96])
        weight = min(1.0, 1.0 / size) if noise.loss == "huber" else 1.0 / (1.0 + size**2)
        expected = np.sqrt(weight) * error / noise.sigma_px
        if not np.allclose(model.whiten(error), expected, rtol=_SAME, atol=0.0):
            return False
    return True
