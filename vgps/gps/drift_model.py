"""A path whose scale and rotation drift slowly, fitted to fixes: the energy (11) with few parameters.

The errors of visual odometry change slowly. The model corrects scale and rotation of the path, the position
of its start, and the time offset between video and GPS. A whole recording is fitted to its fixes in
milliseconds, so that thousands of hypotheses about fixes can be tested in the time of one stage D.
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
_TIME_OFFSET = 3  # index of the time offset among the parameters
_KNOTS = 4  # parameters before those of the knots
_HALVINGS = 8  # of a step that does not lower the cost, before the fit ends
_FIXED_SIGMA_M = 1e-3  # prior sigma of the start of an attached path
_MIN_DECREASE = 1e-4  # relative decrease of the cost that ends a fit


@dataclass(frozen=True)
class Loss:
    """Cauchy loss of scale ``width`` on the offsets of the fixes ``rows`` (M,), relative to ``region_m``
    (M, 3)."""

    region_m: FloatArray
    rows: BoolArray
    width: float


class DriftModel:
    """Drift of a path: scale and rotation of its steps, interpolated between knots that form a random walk.

    Parameters (4 + 4 K,): shift of the start [m] (3,), time offset of the fixes [s], then log scale and
    rotation vector of every knot. A fix is compared with the antenna at its time stamp minus the offset.

    Args:
        path: F >= 2 frames.
        fixes: Fixes at any time; the path is extrapolated beyond its ends.
        camera_p_antenna: (3,) metres.
        config: Drift rates of scale and rotation.
        time_offset_sigma_s: Prior standard deviation of the time offset; 0 holds it at 0.
        attached: Whether the path continues one that is held, so that its start does not move.
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
        self._knot_weight = np.stack([np.interp(frames, at, row) for row in np.eye(self.knots)], axis=1)
        self._step_knots = self._knot_weight[:-1].nonzero()  # pairs of a step and a knot that affects it
        self._poses, self._t_s, self._fixes, self._antenna = poses, t_s, fixes, camera_p_antenna
        sigma = np.array([config.scale_sigma, *[np.radians(config.rotation_sigma_deg)] * 3])
        # the walk's variance grows with the frames between knots
        self._sigma = sigma * np.sqrt(max((at[1] - at[0]) / config.knot_frames, 1e-9))
        self._time_offset_sigma_s = time_offset_sigma_s
        self._shift_sigma_m = _FIXED_SIGMA_M if attached else np.inf
        # (K or K - 1, K) changes from knot to knot
        self._changes = np.diff(np.eye(self.knots), axis=0)
        if attached:
            self._changes = np.vstack([np.eye(1, self.knots), self._changes])
        walk = np.kron(self._changes, np.diag(1.0 / self._sigma))
        self._walk = walk.T @ walk
        self._config = config

    @property
    def start(self) -> FloatArray:
        """Parameters without any correction."""
        return np.zeros(_KNOTS + 4 * self.knots)

    def time_offset_s(self, parameters: FloatArray) -> float:
        """Return the time offset of the fixes."""
        return float(parameters[_TIME_OFFSET])

    def corrected(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the corrected path (F, 4, 4), and the scale correction (F,) of each frame."""
        by_frame = self._knot_weight @ parameters[_KNOTS:].reshape(-1, 4)
        scale = np.exp(np.clip(by_frame[:, 0], -5.0, 5.0))
        rotation = Rotation.from_rotvec(by_frame[:, 1:]).as_matrix()
        steps = np.diff(self._poses[:, :3, 3], axis=0)
        corrected = scale[:-1, None] * (rotation[:-1] @ steps[:, :, None])[:, :, 0]
        out = self._poses.copy()
        out[:, :3, :3] = rotation @ self._poses[:, :3, :3]
        out[0, :3, 3] += parameters[_SHIFT]
        out[1:, :3, 3] = out[0, :3, 3] + np.cumsum(corrected, axis=0)
        return out, scale

    def offsets(self, parameters: FloatArray) -> FloatArray:
        """Return antenna minus fix (M, 3), metres."""
        return self._offsets(self.corrected(parameters)[0], self.time_offset_s(parameters))

    def _offsets(self, corrected: FloatArray, time_offset_s: float) -> FloatArray:
        placement = place(self._t_s, self._fixes.t_s - time_offset_s, beyond=True)
        return antenna_at(corrected, placement, self._antenna) - self._fixes.world_p_fix

    def fit(self, parameters: FloatArray, loss: Loss) -> FloatArray:
        """Return the parameters that minimise ``sum rho(|offset / region|) + sum |change per knot /
        sigma|^2``.

        Iteratively reweighted Gauss-Newton; a step that does not lower the cost is halved.
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
            if before - cost < _MIN_DECREASE * cost:
                break
        return parameters

    def fit_coarse_to_fine(self, rows: BoolArray, finest_m: float) -> FloatArray:
        """Fit fixes with regions as large as the error of the path, then with ever smaller ones.

        So neither a small region nor the initial error of the path decides which fixes count as outliers.

        Args:
            rows: (M,) fixes that contribute.
            finest_m: Added size of the regions at which to stop.
        """
        parameters = self.start
        distance = np.linalg.norm(self.offsets(parameters)[rows], axis=1)
        coarse = max(self._config.coarsest_m, 2.0 * float(np.median(distance)))
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
        """Return the sizes (M, 3) of the fixes' regions, enlarged by ``coarse_m``."""
        fixes = self._fixes
        return np.hypot(np.stack([fixes.r_m, fixes.r_m, fixes.h_m], axis=1), coarse_m)

    def prior_cost(self, parameters: FloatArray) -> float:
        """Return the cost of drift, shift and time offset: the sum of squares in sigmas."""
        change = self._changes @ parameters[_KNOTS:].reshape(-1, 4) / self._sigma
        shift = parameters[_SHIFT] / self._shift_sigma_m
        offset = parameters[_TIME_OFFSET] / self._time_offset_sigma_s if self._time_offset_sigma_s else 0.0
        return float(np.sum(change**2) + np.sum(shift**2) + offset**2)

    def _cost(self, parameters: FloatArray, loss: Loss) -> float:
        squared = self._squared(self.offsets(parameters), loss)
        return float((loss.width**2 * np.log1p(squared / loss.width**2)).sum()) + self.prior_cost(parameters)

    def _squared(self, offset: FloatArray, loss: Loss) -> FloatArray:
        return np.where(loss.rows, np.sum((offset / loss.region_m) ** 2, axis=1), 0.0)

    def _normal(self, parameters: FloatArray, loss: Loss) -> tuple[FloatArray, FloatArray]:
        """Return the reweighted normal equations.

        The Jacobian neglects second-order rotation and the rotation of the lever arm, which changes the
        iterates only, not the minimum.
        """
        corrected, _ = self.corrected(parameters)
        offset = self._offsets(corrected, self.time_offset_s(parameters))
        weight = np.where(loss.rows, 1.0 / (1.0 + self._squared(offset, loss) / loss.width**2), 0.0)
        scale = np.sqrt(weight)[:, None] / loss.region_m  # (M, 3)
        J = self._jacobian(corrected, self.time_offset_s(parameters)) * scale[:, :, None]
        J, r = J.reshape(-1, J.shape[2]), (offset * scale).ravel()
        hessian, gradient = J.T @ J, J.T @ r
        knots = slice(_KNOTS, None)
        hessian[knots, knots] += self._walk
        gradient[knots] += self._walk @ parameters[knots]
        hessian[_SHIFT, _SHIFT] += np.eye(3) / self._shift_sigma_m**2
        gradient[_SHIFT] += parameters[_SHIFT] / self._shift_sigma_m**2
        if self._time_offset_sigma_s:
            hessian[_TIME_OFFSET, _TIME_OFFSET] += self._time_offset_sigma_s**-2
            gradient[_TIME_OFFSET] += parameters[_TIME_OFFSET] * self._time_offset_sigma_s**-2
        else:
            hessian[_TIME_OFFSET], hessian[:, _TIME_OFFSET], gradient[_TIME_OFFSET] = 0.0, 0.0, 0.0
            hessian[_TIME_OFFSET, _TIME_OFFSET] = 1.0
        # keeps parameters that no fix determines
        hessian[np.diag_indices_from(hessian)] += 1e-9 * (1.0 + np.diagonal(hessian))
        return hessian, gradient

    def _jacobian(self, corrected: FloatArray, time_offset_s: float) -> FloatArray:
        """Return the Jacobian (M, 3, 4 + 4 K) of the offsets."""
        steps = np.diff(corrected[:, :3, 3], axis=0)
        zero = np.zeros(len(steps))
        x, y, z = steps.T
        # a step's derivative by log scale and by a rotation w: the step itself, and w x step
        by_parameter = np.stack(
            [steps, *np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(0, 2, 1)], axis=1
        )
        placement = place(self._t_s, self._fixes.t_s - time_offset_s, beyond=True)
        frame, alpha = placement.frame, placement.alpha
        J = np.zeros((len(frame), 3, _KNOTS + 4 * self.knots))
        J[:, :, _SHIFT] = np.eye(3)
        interval = (self._t_s[frame + 1] - self._t_s[frame])[:, None]
        J[:, :, _TIME_OFFSET] = -steps[frame] / interval
        last = (
            self._knot_weight[frame][:, :, None]
            * by_parameter[frame].reshape(-1, 1, 12)
            * alpha[:, None, None]
        )
        by_knot = (self._sums_before(frame, by_parameter.reshape(-1, 12)) + last).reshape(len(frame), -1, 3)
        J[:, :, _KNOTS:] = by_knot.transpose(0, 2, 1)
        return J

    def _sums_before(self, frame: IntArray, by_parameter: FloatArray) -> FloatArray:
        """Return sums (M, K, 12) over all steps before each of the frames (M,), weighted by knot."""
        order = np.argsort(frame, kind="stable")
        step, knot = self._step_knots
        since = np.searchsorted(frame[order], step, side="right")  # first frame after the step
        counted = since < len(frame)
        step, knot, since = step[counted], knot[counted], since[counted]
        entries = (self._knot_weight[step, knot], (since * self.knots + knot, step))
        size = (len(frame) * self.knots, len(by_parameter))
        increments = np.asarray(sparse.csr_array(entries, shape=size) @ by_parameter)
        out = np.empty((len(frame), self.knots, 12))
        out[order] = np.cumsum(increments.reshape(out.shape), axis=0)
        return out
