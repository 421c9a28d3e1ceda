"""A path whose scale and rotation drift slowly, fitted to fixes: the energy (11) with few parameters.

The errors of visual odometry change slowly. The model corrects scale and rotation of the path, the position
of its start, and the time offset between video and GPS. A fit takes milliseconds for a minute of video and
grows linearly with its length, so that many hypotheses about fixes can be tested in the time of one stage D.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import DriftConfig
from vgps.gps.antenna_path import Placement, antenna_at, place
from vgps.gps.drift_equations import DRIFT_DIM, DRIFTS, INTERVAL_DIM, POSITION, DriftEquations, KnotIntervals
from vgps.gps.fixes import Fixes, seconds_after
from vgps.model import BoolArray, FloatArray
from vgps.solution import Trajectory

_SHIFT = slice(0, 3)
_TIME_OFFSET = 3  # index of the time offset among the parameters
_KNOTS = 4  # parameters before those of the knots
_TILT = slice(1, 3)  # among the four of a knot: rotation about east and north
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


@dataclass(frozen=True)
class _Candidate:
    """Parameters, the path (F, 4, 4) corrected by them, its frames around the fixes, and antenna minus fix
    (M, 3)."""

    parameters: FloatArray
    path: FloatArray
    placement: Placement
    offset: FloatArray


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
        tilt_sigma_rad: Prior standard deviation of the start's tilt about each horizontal axis; none by
            default. Fixes along a straight hardly show a roll about it, and the errors of coarse ones would
            turn the path upside down.
        seams: (F - 1, 2) variances of log scale and of the rotation about each axis, rad^2, by which each
            step may differ from the one before beyond that walk, as at the seams of several maps.
    """

    def __init__(
        self,
        path: Trajectory,
        fixes: Fixes,
        camera_p_antenna: FloatArray,
        config: DriftConfig,
        time_offset_sigma_s: float = 0.0,
        attached: bool = False,
        tilt_sigma_rad: float = np.inf,
        seams: FloatArray | None = None,
    ) -> None:
        poses, t_s = path.world_T_camera, path.t_s
        self.knots = 2 + int(len(poses) / config.knot_frames)
        self._intervals = KnotIntervals(len(poses), self.knots)
        self._poses, self._t_s, self._fixes, self._antenna = poses, t_s, fixes, camera_p_antenna
        sigma = np.array([config.scale_sigma, *[np.radians(config.rotation_sigma_deg)] * 3])
        # the walk's variance grows with the frames between knots
        walk = np.tile(sigma * np.sqrt(self._intervals.spacing / config.knot_frames), (self.knots - 1, 1))
        if seams is not None:
            variance = np.zeros_like(walk)
            np.add.at(variance, self._intervals.of_frame[:-1], seams[:, [0, 1, 1, 1]])
            walk = np.hypot(walk, np.sqrt(variance))
        self._sigma = np.concatenate([walk[:1], walk]) if attached else walk
        self._time_offset_sigma_s = time_offset_sigma_s
        self._attached = attached
        self._tilt_information = tilt_sigma_rad**-2
        self._config = config
        # many fixes a second tell where the path is no better than one does
        self._weight = seconds_after(fixes)

    @property
    def start(self) -> FloatArray:
        """Parameters without any correction."""
        return np.zeros(_KNOTS + DRIFT_DIM * self.knots)

    def time_offset_s(self, parameters: FloatArray) -> float:
        """Return the time offset of the fixes."""
        return float(parameters[_TIME_OFFSET])

    def corrected(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the corrected path (F, 4, 4), and the scale correction (F,) of each frame."""
        by_frame = self._intervals.at_frames(parameters[_KNOTS:].reshape(-1, DRIFT_DIM))
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
        return self._at(parameters).offset

    def _at(self, parameters: FloatArray) -> _Candidate:
        path, _ = self.corrected(parameters)
        placement = place(self._t_s, self._fixes.t_s - self.time_offset_s(parameters), beyond=True)
        offset = antenna_at(path, placement, self._antenna) - self._fixes.world_p_fix
        return _Candidate(parameters, path, placement, offset)

    def fit(self, parameters: FloatArray, loss: Loss) -> FloatArray:
        """Return the parameters that minimise ``sum rho(|offset / region|) + sum |change per knot /
        sigma|^2``.

        Iteratively reweighted Gauss-Newton; a step that does not lower the cost is halved.
        """
        best = self._at(parameters)
        cost = self._cost(best, loss)
        for _ in range(self._config.iterations):
            step = self._step(best, loss)
            for halving in range(_HALVINGS):
                trial = self._at(best.parameters + step * 0.5**halving)
                trial_cost = self._cost(trial, loss)
                if trial_cost < cost:
                    break
            else:
                return best.parameters
            best, before, cost = trial, cost, trial_cost
            if before - cost < _MIN_DECREASE * cost:
                break
        return best.parameters

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
        return self._cost(self._at(parameters), Loss(regions, rows, self._config.robust_regions))

    def regions(self, coarse_m: float = 0.0) -> FloatArray:
        """Return the sizes (M, 3) of the fixes' regions, enlarged by ``coarse_m``."""
        fixes = self._fixes
        return np.hypot(np.stack([fixes.r_m, fixes.r_m, fixes.h_m], axis=1), coarse_m)

    def prior_costs(self, parameters: FloatArray) -> FloatArray:
        """Return the costs (K - 1,) of the drift in each interval between knots: sums of squares in sigmas.

        The first one's has those of shift, tilt and time offset.
        """
        squared: FloatArray = np.sum((self._changes(parameters) / self._sigma) ** 2, axis=1)
        costs = squared[-(self.knots - 1) :]
        costs[0] += squared[: -(self.knots - 1)].sum()
        if self._attached:
            costs[0] += np.sum((parameters[_SHIFT] / _FIXED_SIGMA_M) ** 2)
        costs[0] += self._tilt_information * np.sum(parameters[_KNOTS:][_TILT] ** 2)
        if self._time_offset_sigma_s:
            costs[0] += (parameters[_TIME_OFFSET] / self._time_offset_sigma_s) ** 2
        return costs

    def _changes(self, parameters: FloatArray) -> FloatArray:
        """Return the changes (K - 1, 4) from knot to knot; where attached (K, 4), also to the first."""
        drift = parameters[_KNOTS:].reshape(-1, DRIFT_DIM)
        return np.diff(drift, axis=0, prepend=np.zeros((1, DRIFT_DIM)) if self._attached else drift[:0])

    def _cost(self, candidate: _Candidate, loss: Loss) -> float:
        squared = self._squared(candidate.offset, loss)
        of_fixes = loss.width**2 * np.log1p(squared / loss.width**2)
        return float(self._weight @ of_fixes + self.prior_costs(candidate.parameters).sum())

    def _squared(self, offset: FloatArray, loss: Loss) -> FloatArray:
        return np.where(loss.rows, np.sum((offset / loss.region_m) ** 2, axis=1), 0.0)

    def _step(self, candidate: _Candidate, loss: Loss) -> FloatArray:
        """Return the reweighted Gauss-Newton step.

        The Jacobian neglects second-order rotation and the rotation of the lever arm, which changes the
        iterates only, not the minimum.
        """
        parameters, equations, time_prior = candidate.parameters, self._equations(candidate, loss), None
        if self._time_offset_sigma_s:
            information = self._time_offset_sigma_s**-2
            time_prior = information, information * parameters[_TIME_OFFSET]
        by_interval, time_step = equations.step(*self._prior(parameters), time_prior)
        drift = by_interval[:, DRIFTS].reshape(-1, 2, DRIFT_DIM)
        return np.concatenate([by_interval[0, POSITION], [time_step], drift[:, 0].ravel(), drift[-1, 1]])

    def _equations(self, candidate: _Candidate, loss: Loss) -> DriftEquations:
        """Return the equations of the fixes, whitened and weighted by the loss."""
        placement, offset = candidate.placement, candidate.offset
        robust = 1.0 / (1.0 + self._squared(offset, loss) / loss.width**2)
        weight = np.where(loss.rows, self._weight * robust, 0.0)
        scale = np.sqrt(weight)[:, None] / loss.region_m  # (M, 3)
        frame, alpha = placement.frame, placement.alpha[:, None, None]
        steps = np.diff(candidate.path[:, :3, 3], axis=0)
        by_step, within, across = self._intervals.derivatives(steps)
        J = np.zeros((len(frame), 3, INTERVAL_DIM))
        J[:, :, POSITION] = np.eye(3)
        J[:, :, DRIFTS] = within[frame] + alpha * by_step[frame]
        return DriftEquations(
            interval=self._intervals.of_frame[frame],
            J=J * scale[:, :, None],
            J_time=-steps[frame] / (self._t_s[frame + 1] - self._t_s[frame])[:, None] * scale,
            r=offset * scale,
            across=across,
        )

    def _prior(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return Hessian (K - 1, 11, 11) and gradient (K - 1, 11) of walk and start in the intervals."""
        information = self._sigma[-(self.knots - 1) :] ** -2
        hessian = np.zeros((self.knots - 1, INTERVAL_DIM, INTERVAL_DIM))
        gradient = np.zeros((self.knots - 1, INTERVAL_DIM))
        blocks = information[:, :, None] * np.eye(DRIFT_DIM)
        hessian[:, DRIFTS, DRIFTS] = np.block([[blocks, -blocks], [-blocks, blocks]])
        pull = information * self._changes(parameters)[-(self.knots - 1) :]
        gradient[:, DRIFTS] = np.concatenate([-pull, pull], axis=1)
        if self._attached:
            start = np.append(np.full(3, _FIXED_SIGMA_M**-2), self._sigma[0] ** -2)
            first = np.append(parameters[_SHIFT], parameters[_KNOTS : _KNOTS + DRIFT_DIM])
            hessian[0, : len(start), : len(start)] += np.diag(start)
            gradient[0, : len(start)] += start * first
        tilt = np.arange(INTERVAL_DIM)[DRIFTS][_TILT]
        hessian[0, tilt, tilt] += self._tilt_information
        gradient[0, tilt] += self._tilt_information * parameters[_KNOTS:][_TILT]
        return hessian, gradient
