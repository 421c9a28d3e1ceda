"""A lens fitted to the epipolar geometry of many pairs of views, without a map.

All pairs share the lens. Levenberg-Marquardt eliminates the geometry of the pairs, 5 unknowns each, from the
equations of the lens.
"""

from dataclasses import dataclass, replace

import numpy as np

from vgps.camera_calibration.pair_geometry import (
    POSE_PRIOR,
    PairRays,
    cauchy_loss,
    essential_starts,
    pose_step,
    pure_rotations,
    retracted,
    sums_by_pair,
)
from vgps.model import FloatArray
from vgps.tracking.view_pairs import ViewPairs

_STEPS = np.array([1e-6, 1e-3, 1e-3, 1e-6, 1e-6])  # of the numerical derivatives by the lens
_POSE_STEPS = 8
_CONVERGED = 1e-5  # relative decrease of the cost
_FINAL_DAMPING = 1e8


@dataclass(frozen=True)
class LensPrior:
    """Model, mean (5,) and standard deviations (5,) of the parameters of a lens, see `lens.parameters_of`."""

    model: str
    mean: FloatArray
    sigma: FloatArray


@dataclass(frozen=True)
class LensFit:
    """A lens and the geometry of the pairs.

    Attributes:
        model: Of the lens.
        parameters: (5,) see `lens.parameters_of`.
        rotation: (P, 3, 3) second_R_first of each pair.
        direction: (P, 3) unit vectors of the motion, in the second camera's axes.
        cost: Sum of the losses, with the prior.
        information: (5, 5) of the parameters, prior included.
    """

    model: str
    parameters: FloatArray
    rotation: FloatArray
    direction: FloatArray
    cost: float
    information: FloatArray


def fit_lens(
    pairs: ViewPairs, prior: LensPrior, start: FloatArray, noise_px: float, iterations: int
) -> LensFit:
    """Fit a lens to pairs of views, from a start of its parameters.

    Args:
        pairs: Features of the pairs.
        prior: Of the lens.
        start: (5,) where the search begins.
        noise_px: Standard deviation of a Sampson distance, and constant of Cauchy's loss.
        iterations: Steps at most.
    """
    fit = start_of_pairs(pairs, prior, start, noise_px)
    damping = 1e-3
    for _ in range(iterations):
        step = _normal_equations(pairs, prior, fit, noise_px)
        before = fit.cost
        while damping < _FINAL_DAMPING:
            moved = step.moved(fit, damping)
            moved = replace(moved, cost=_cost(pairs, prior, moved, noise_px))
            if moved.cost < fit.cost:
                fit, damping = moved, max(damping / 10.0, 1e-9)
                break
            damping *= 10.0
        fit = replace(fit, information=step.information)
        if before - fit.cost <= _CONVERGED * before:
            break
    return fit


def start_of_pairs(pairs: ViewPairs, prior: LensPrior, parameters: FloatArray, noise_px: float) -> LensFit:
    """Return the best geometry of each pair for a lens, from its essential matrix or from a pure rotation."""
    lens = PairRays(pairs, prior.model, parameters)
    rotation = pure_rotations(pairs, lens)
    starts = [(rotation, np.tile(axis, (pairs.count, 1))) for axis in np.eye(3)]
    starts.append(essential_starts(pairs, lens, rotation, noise_px / float(np.exp(parameters[0]))))
    best = np.full(pairs.count, np.inf)
    chosen = rotation.copy(), starts[0][1].copy()
    for start in starts:
        R, t = start
        for _ in range(_POSE_STEPS):
            R, t = pose_step(pairs, lens, R, t, noise_px)
        loss = np.bincount(pairs.pair, cauchy_loss(lens.residual(R, t) / noise_px), pairs.count)
        better = loss < best
        best[better] = loss[better]
        chosen[0][better], chosen[1][better] = R[better], t[better]
    fit = LensFit(prior.model, parameters, *chosen, 0.0, np.eye(5))
    return replace(fit, cost=_cost(pairs, prior, fit, noise_px))


def noise_of(pairs: ViewPairs, fit: LensFit) -> float:
    """Return the robust standard deviation of the Sampson distances, pixels."""
    residual = PairRays(pairs, fit.model, fit.parameters).residual(fit.rotation, fit.direction)
    return 1.4826 * float(np.median(np.abs(residual)))


def pair_losses(pairs: ViewPairs, fit: LensFit, noise_px: float) -> FloatArray:
    """Return the sum of the losses of each pair, (P,)."""
    residual = PairRays(pairs, fit.model, fit.parameters).residual(fit.rotation, fit.direction)
    losses = np.bincount(pairs.pair, cauchy_loss(residual / noise_px), pairs.count)
    return np.asarray(losses, np.float64)


@dataclass(frozen=True)
class _Step:
    """The normal equations of lens and pairs: A_pp (P, 5, 5), A_pl (P, 5, 5), their gradients, and the lens
    with the pairs eliminated."""

    pairs: FloatArray
    coupling: FloatArray
    pair_gradient: FloatArray
    lens: FloatArray
    lens_gradient: FloatArray
    information: FloatArray

    def moved(self, fit: LensFit, damping: float) -> LensFit:
        """Return the fit after a damped step."""
        damped = self.pairs * (1.0 + damping * np.eye(5))
        solved = np.linalg.solve(
            damped, np.concatenate([self.coupling, self.pair_gradient[..., None]], axis=2)
        )
        lens = self.lens * (1.0 + damping * np.eye(5))
        reduced = lens - np.einsum("pki,pkj->ij", self.coupling, solved[..., :5])
        gradient = self.lens_gradient - np.einsum("pki,pk->i", self.coupling, solved[..., 5])
        delta = -np.linalg.solve(reduced, gradient)
        poses = -(solved[..., 5] + solved[..., :5] @ delta)
        rotation, direction = retracted(fit.rotation, fit.direction, poses)
        return replace(fit, parameters=fit.parameters + delta, rotation=rotation, direction=direction)


def _normal_equations(pairs: ViewPairs, prior: LensPrior, fit: LensFit, noise_px: float) -> _Step:
    """Linearise about a fit; residuals and Jacobians are divided by the noise."""
    lens = PairRays(pairs, fit.model, fit.parameters)
    here = lens.residual(fit.rotation, fit.direction)
    r = here / noise_px
    weight = 1.0 / (1.0 + r**2)
    by_pose = lens.by_pose(fit.rotation, fit.direction) / noise_px
    by_lens = _by_lens(pairs, fit, here) / noise_px
    A_pp = sums_by_pair(pairs, weight, by_pose, by_pose) + np.diag(POSE_PRIOR / noise_px**2)
    A_pl = sums_by_pair(pairs, weight, by_pose, by_lens)
    g_p = sums_by_pair(pairs, weight, by_pose, r[:, None])[..., 0]
    precision = 1.0 / prior.sigma**2
    A_ll = (weight[:, None] * by_lens).T @ by_lens + np.diag(precision)
    g_l = by_lens.T @ (weight * r) + precision * (fit.parameters - prior.mean)
    information = A_ll - np.einsum("pki,pkj->ij", A_pl, np.linalg.solve(A_pp, A_pl))
    return _Step(A_pp, A_pl, g_p, A_ll, g_l, information)


def _by_lens(pairs: ViewPairs, fit: LensFit, here: FloatArray) -> FloatArray:
    """Return the derivatives (N, 5) of the distances ``here`` by the parameters of the lens."""

    def residual(parameters: FloatArray) -> FloatArray:
        return PairRays(pairs, fit.model, parameters).residual(fit.rotation, fit.direction)

    return np.stack(
        [(residual(fit.parameters + d) - here) / d.sum() for d in np.diag(_STEPS)],
        axis=1,
    )


def _cost(pairs: ViewPairs, prior: LensPrior, fit: LensFit, noise_px: float) -> float:
    residual = PairRays(pairs, fit.model, fit.parameters).residual(fit.rotation, fit.direction)
    off = (fit.parameters - prior.mean) / prior.sigma
    return float(cauchy_loss(residual / noise_px).sum() + 0.5 * off @ off)
