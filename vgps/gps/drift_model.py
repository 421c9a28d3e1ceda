"""A path whose scale and rotation drift slowly, fitted to fixes: the energy (11) with few parameters.

The errors of a camera alone change slowly: scale and rotation of its path, and the position of its start.
Here only these vary, and the time offset between video and GPS, so that a whole recording is fitted to its
fixes in milliseconds, and thousands of hypotheses about fixes can be tested where stage D would test one.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from vgps.config import DriftConfig
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Trajectory

_SHIFT = slice(0, 3)
_CLOCK = 3  # place of the time offset among the parameters
_KNOTS = 4  # parameters before those of the knots
_HALVINGS = 8  # a guard: of a step that does not lower the cost
_HELD_M = 1e-3  # prior sigma of a start that is held
_SMALL = 1e-4  # relative decrease of the cost that ends a fit


@dataclass(frozen=True)
class Loss:
    """Cauchy's loss of the fixes' offsets in units of ``region_m`` (M, 3), of scale ``width``.

    Only the fixes ``rows`` (M,) take part.
    """

    region_m: FloatArray
    rows: BoolArray
    width: float


class DriftModel:
    """Steps scaled and rotated by values interpolated between knots, which change as a random walk.

    Parameters (4 + 4 K,): shift of the start [m] (3,), time offset of the fixes [s], then log scale and
    rotation vector of every knot. The antenna is compared with a fix at the fix's time minus the offset.

    Args:
        path: F >= 2 frames.
        fixes: They may lie anywhere; outside the path's time it is extrapolated.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift.
        time_offset_sigma_s: Prior standard deviation of the time offset; 0 holds it at 0.
        attached: The start continues a path that is held: it stays, and may bend there as elsewhere.
    """

    def __init__(
        self,
        path: Trajectory,
        fixes: Fixes,
        camera_p_antenna: FloatArray,
        config: DriftConfig,
        time_offset_sigma_s: float = 0.0,
        attached: bool = False,
    ) -> None:
        poses, t_s = path.world_T_camera, path.t_s
        self.knots = 2 + min(int(len(poses) / config.knot_frames), config.max_knots)
        at = np.linspace(0, len(poses) - 1, self.knots)
        frames = np.arange(len(poses))
        # (F, K) weight of each knot in each frame
        self._share = np.stack([np.interp(frames, at, row) for row in np.eye(self.knots)], axis=1)
        self._counted = self._share[:-1].nonzero()  # the two knots of every step
        self._poses, self._t_s, self._fixes, self._antenna = poses, t_s, fixes, camera_p_antenna
        sigma = np.array([config.scale_sigma, *[np.radians(config.rotation_sigma_deg)] * 3])
        # the walk's variance grows with the frames between knots
        self._sigma = sigma * np.sqrt(max((at[1] - at[0]) / config.knot_frames, 1e-9))
        self._time_offset_sigma_s = time_offset_sigma_s
        self._shift_sigma_m = _HELD_M if attached else np.inf
        # (K or K - 1, K) changes from knot to knot
        self._changes = np.diff(np.eye(self.knots), axis=0)
        if attached:
            self._changes = np.vstack([np.eye(1, self.knots), self._changes])
        walk = np.kron(self._changes, np.diag(1.0 / self._sigma))
        self._walk = walk.T @ walk
        self._config = config

    @property
    def start(self) -> FloatArray:
        """Parameters that leave the path as it is."""
        return np.zeros(_KNOTS + 4 * self.knots)

    def time_offset_s(self, parameters: FloatArray) -> float:
        """Return the time offset of the fixes."""
        return float(parameters[_CLOCK])

    def bent(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the bent path (F, 4, 4), and the scale (F,) by which each frame's view grew."""
        by_frame = self._share @ parameters[_KNOTS:].reshape(-1, 4)
        scale = np.exp(np.clip(by_frame[:, 0], -5.0, 5.0))
        rotation = Rotation.from_rotvec(by_frame[:, 1:]).as_matrix()
        steps = np.diff(self._poses[:, :3, 3], axis=0)
        turned = scale[:-1, None] * (rotation[:-1] @ steps[:, :, None])[:, :, 0]
        out = self._poses.copy()
        out[:, :3, :3] = rotation @ self._poses[:, :3, :3]
        out[0, :3, 3] += parameters[_SHIFT]
        out[1:, :3, 3] = out[0, :3, 3] + np.cumsum(turned, axis=0)
        return out, scale

    def offsets(self, parameters: FloatArray) -> FloatArray:
        """Return antenna minus fix (M, 3), metres."""
        return self._offsets(self.bent(parameters)[0], self.time_offset_s(parameters))

    def _offsets(self, bent: FloatArray, time_offset_s: float) -> FloatArray:
        placement = place(self._t_s, self._fixes.t_s - time_offset_s, beyond=True)
        return antenna_at(bent, placement, self._antenna) - self._fixes.world_p_fix

    def fit(self, parameters: FloatArray, loss: Loss) -> FloatArray:
        """Return the parameters that minimise ``sum rho(|offset / region|) + sum |change per knot /
        sigma|^2``.

        Iteratively reweighted Gauss-Newton; a step that does not help is halved.
        """
        cost = self._cost(parameters, loss)
        for _ in range(self._config.iterations):
            hessian, gradient = self._normal(parameters, loss)
            step = -cho_solve(cho_factor(hessian), gradient)
            for halving in range(_HALVINGS):
                trial = parameters + step * 0.5**halving
                trial_cost = self._cost(trial, loss)
                if trial_cost < cost:
                    break
            else:
                return parameters
            parameters, before, cost = trial, cost, trial_cost
            if before - cost < _SMALL * cost:
                break
        return parameters

    def fit_coarse_to_fine(self, rows: BoolArray, finest_m: float) -> FloatArray:
        """Fit the fixes as if each were as coarse as the path is wrong, then finer and finer.

        So neither a fine class nor the initial errors of the path decide which fixes count.

        Args:
            rows: (M,) fixes that take part.
            finest_m: Where to stop.
        """
        parameters = self.start
        away = np.linalg.norm(self.offsets(parameters)[rows], axis=1)
        coarse = max(self._config.coarsest_m, 2.0 * float(np.median(away)))
        while coarse > finest_m:
            parameters = self.fit(parameters, Loss(self.regions(coarse), rows, 1.0))
            coarse /= self._config.refinement_ratio
        return parameters

    def refine(self, parameters: FloatArray, rows: BoolArray, regions: FloatArray) -> FloatArray:
        """Fit the fixes ``rows`` with their regions (M, 3), from a coarse fit."""
        return self.fit(parameters, Loss(regions, rows, self._config.robust_regions))

    def cost(self, parameters: FloatArray, rows: BoolArray, regions: FloatArray) -> float:
        """Return the cost that :meth:`refine` minimises."""
        return self._cost(parameters, Loss(regions, rows, self._config.robust_regions))

    def regions(self, coarse_m: float = 0.0) -> FloatArray:
        """Return the sizes (M, 3) of the fixes' regions, made coarser by ``coarse_m``."""
        fixes = self._fixes
        return np.hypot(np.stack([fixes.r_m, fixes.r_m, fixes.h_m], axis=1), coarse_m)

    def prior_cost(self, parameters: FloatArray) -> float:
        """Return the cost of bending, shift and time offset: the sum of squares in sigmas."""
        change = self._changes @ parameters[_KNOTS:].reshape(-1, 4) / self._sigma
        shift = parameters[_SHIFT] / self._shift_sigma_m
        offset = parameters[_CLOCK] / self._time_offset_sigma_s if self._time_offset_sigma_s else 0.0
        return float(np.sum(change**2) + np.sum(shift**2) + offset**2)

    def _cost(self, parameters: FloatArray, loss: Loss) -> float:
        away2 = self._away2(self.offsets(parameters), loss)
        return float((loss.width**2 * np.log1p(away2 / loss.width**2)).sum()) + self.prior_cost(parameters)

    def _away2(self, offset: FloatArray, loss: Loss) -> FloatArray:
        return np.where(loss.rows, np.sum((offset / loss.region_m) ** 2, axis=1), 0.0)

    def _normal(self, parameters: FloatArray, loss: Loss) -> tuple[FloatArray, FloatArray]:
        """Return the reweighted normal equations.

        The rotations' curvature and the rotation of the lever arm are left out, which changes the iterates
        and not the minimum.
        """
        bent, _ = self.bent(parameters)
        offset = self._offsets(bent, self.time_offset_s(parameters))
        weight = np.where(loss.rows, 1.0 / (1.0 + self._away2(offset, loss) / loss.width**2), 0.0)
        scale = np.sqrt(weight)[:, None] / loss.region_m  # (M, 3)
        J = self._jacobian(bent, self.time_offset_s(parameters)) * scale[:, :, None]
        J, r = J.reshape(-1, J.shape[2]), (offset * scale).ravel()
        hessian, gradient = J.T @ J, J.T @ r
        own = slice(_KNOTS, None)
        hessian[own, own] += self._walk
        gradient[own] += self._walk @ parameters[own]
        hessian[_SHIFT, _SHIFT] += np.eye(3) / self._shift_sigma_m**2
        gradient[_SHIFT] += parameters[_SHIFT] / self._shift_sigma_m**2
        if self._time_offset_sigma_s:
            hessian[_CLOCK, _CLOCK] += self._time_offset_sigma_s**-2
            gradient[_CLOCK] += parameters[_CLOCK] * self._time_offset_sigma_s**-2
        else:
            hessian[_CLOCK], hessian[:, _CLOCK], gradient[_CLOCK] = 0.0, 0.0, 0.0
            hessian[_CLOCK, _CLOCK] = 1.0
        # where no fix determines the path it stays as it is
        hessian[np.diag_indices_from(hessian)] += 1e-9 * (1.0 + np.diagonal(hessian))
        return hessian, gradient

    def _jacobian(self, bent: FloatArray, time_offset_s: float) -> FloatArray:
        """Return the Jacobian (M, 3, 4 + 4 K) of the offsets."""
        steps = np.diff(bent[:, :3, 3], axis=0)
        zero = np.zeros(len(steps))
        x, y, z = steps.T
        # a step's derivative by log scale and by a rotation w: the step itself, and w x step
        by_own = np.stack(
            [steps, *np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(0, 2, 1)], axis=1
        )
        placement = place(self._t_s, self._fixes.t_s - time_offset_s, beyond=True)
        frame, alpha = placement.frame, placement.alpha
        J = np.zeros((len(frame), 3, _KNOTS + 4 * self.knots))
        J[:, :, _SHIFT] = np.eye(3)
        interval = (self._t_s[frame + 1] - self._t_s[frame])[:, None]
        J[:, :, _CLOCK] = -steps[frame] / interval
        last = self._share[frame][:, :, None] * by_own[frame].reshape(-1, 1, 12) * alpha[:, None, None]
        by_knot = (self._before(frame, by_own.reshape(-1, 12)) + last).reshape(len(frame), -1, 3)
        J[:, :, _KNOTS:] = by_knot.transpose(0, 2, 1)
        return J

    def _before(self, frame: IntArray, by_own: FloatArray) -> FloatArray:
        """Return sums (M, K, 12) over all steps before each of the frames (M,), weighted by knot."""
        order = np.argsort(frame, kind="stable")
        step, knot = self._counted
        since = np.searchsorted(frame[order], step, side="right")  # the first frame that comes after the step
        some = since < len(frame)
        step, knot, since = step[some], knot[some], since[some]
        entries = (self._share[step, knot], (since * self.knots + knot, step))
        size = (len(frame) * self.knots, len(by_own))
        new = np.asarray(sparse.csr_array(entries, shape=size) @ by_own)
        out = np.empty((len(frame), self.knots, 12))
        out[order] = np.cumsum(new.reshape(out.shape), axis=0)
        return out
