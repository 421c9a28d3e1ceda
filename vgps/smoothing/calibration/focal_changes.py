"""Changes of the focal length during a video, as by focus or zoom, that its observations show.

Their logarithm is a chain of knots: it walks at random, and is drawn back to the mean within seconds. How far
it walks is what makes the observations likeliest, with poses, landmarks and calibration integrated out (the
linearised problem is Gaussian). Without a walk the focal length stays: by how much less likely that is
decides whether it changes at all. Fixes whose errors are not as modelled ask for changes, too; those the
pictures contradict, or at least do not bear out.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from vgps.camera import distort, undistort
from vgps.model import Camera, FloatArray, FocalChanges, IntArray
from vgps.smoothing.calibration.camera_equations import camera_jacobian, summed_equations
from vgps.smoothing.calibration.parameter_step import ParameterPrior, without_poses
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem

_SPACING_S = 1.0  # a lens takes about as long to focus anew
_MOST_KNOTS = 200  # each is a column beside all poses
_WALKS = np.geomspace(5e-4, 0.2, 14)  # of log focal length in a second: from what no video shows to a zoom
_DRAWN_BACK = 3.0  # standard deviation of log focal length over its walk in a second
_CLEAR = np.log(100.0)  # by so much likelier, and the focal length changes
_CLEAR_BY_FIXES = 2.0 * _CLEAR  # where pictures alone, as of flat ground straight below, hardly show it
_NOTABLE = 0.5 * np.log(10.0)  # a smaller difference is not worth more than a bare mention (Jeffreys)


@dataclass(frozen=True)
class FocalEquations:
    """Normal equations (K, K) and (K,) of log focal length at knots (K,) [s], all else eliminated."""

    t_s: FloatArray
    hessian: FloatArray
    gradient: FloatArray

    def about(self, log_ratio: FloatArray) -> "FocalEquations":
        """Return equations of the whole change if these are of what is left after a part (K,) of it."""
        return FocalEquations(self.t_s, self.hessian, self.gradient - self.hessian @ log_ratio)

    def gain(self, log_ratio: FloatArray) -> float:
        """Return the log of how much likelier all observations are with a change (K,) than with none."""
        return -float(0.5 * log_ratio @ self.hessian @ log_ratio + self.gradient @ log_ratio)

    def likeliest(self) -> tuple[FloatArray, float]:
        """Return the change (K,), and the log of how much likelier it is than none."""
        found = max((self._given(walk) for walk in _WALKS), key=lambda one: one[1])
        return found if found[1] > 0.0 else (np.zeros_like(self.t_s), 0.0)

    def _given(self, walk: float) -> tuple[FloatArray, float]:
        """Return the change for a walk in a second, and the log of its evidence over that of no change."""
        D = np.diff(np.eye(len(self.t_s)), axis=0)
        prior = (
            D.T @ (D / (walk**2 * np.diff(self.t_s))[:, None])
            + np.eye(len(D) + 1) / (_DRAWN_BACK * walk) ** 2
        )
        posterior = self.hessian + prior
        change: FloatArray = -np.linalg.solve(posterior, self.gradient).astype(np.float64)
        logs = [np.linalg.slogdet(matrix)[1] for matrix in (prior, posterior)]
        return change, float(0.5 * (logs[0] - logs[1] - self.gradient @ change))


def is_clear(evidence: float, by_pictures: float = np.inf) -> bool:
    """Whether the focal length changes.

    Args:
        evidence: The log of how much likelier that is.
        by_pictures: The same of the pictures alone; infinite if it is known to change.
    """
    if abs(by_pictures) < _NOTABLE:
        return bool(evidence > _CLEAR_BY_FIXES)
    return bool(by_pictures > 0.0 and evidence > _CLEAR)


def focal_equations(
    problem: BundleProblem, camera: Camera, prior: ParameterPrior, t_s: FloatArray
) -> FocalEquations:
    """Return the equations of changes of the focal length at the optimum of a problem.

    Args:
        problem: Near its optimum; its observations are undistorted by ``camera``.
        camera: The calibration.
        prior: Of the calibration, which is eliminated, too.
        t_s: (F,) times of the frames.

    Raises:
        NotPositiveDefiniteError: The poses are not determined.
    """
    structure, size = analyse_sparsity(problem), len(prior.sigma)
    linear = linearise(problem, all_pose_values(problem), structure)
    count = int(np.clip(np.ceil(np.ptp(t_s) / _SPACING_S), 1, _MOST_KNOTS - 1)) + 1
    knots = np.linspace(t_s[0], t_s[-1], count)
    share = np.stack([np.interp(t_s, knots, one) for one in np.eye(count)], axis=1)

    def jacobians() -> Iterator[tuple[FloatArray, IntArray]]:
        for part in linear.chunks:
            calibration = camera_jacobian(problem, part, camera, size)
            of_frame = share[part.chunk.frame + part.chunk.first_frame]
            near = np.flatnonzero(of_frame.any(axis=0))
            by_knot = of_frame[:, near].T[:, None] * calibration[0]
            yield np.concatenate([calibration, by_knot]), np.append(np.arange(size), size + near)

    equations = summed_equations(linear, structure, jacobians(), size + count)
    hessian, gradient, _ = without_poses(linear, structure, equations)
    hessian[:size, :size] += np.diag(1.0 / prior.sigma**2)
    gradient[:size] += prior.moved / prior.sigma**2
    right = np.column_stack([hessian[:size, size:], gradient[:size]])
    calibrated = np.linalg.solve(hessian[:size, :size], right)
    return FocalEquations(
        knots,
        hessian[size:, size:] - hessian[size:, :size] @ calibrated[:, :-1],
        gradient[size:] - hessian[size:, :size] @ calibrated[:, -1],
    )


def of_pictures_alone(problem: BundleProblem) -> BundleProblem:
    """Return the problem without fixes and all else that is known of the poses beside the observations."""
    return replace(problem, pose_graph=gtsam.NonlinearFactorGraph(), shared={}, states={})


def gain_of_pictures(
    log_ratio: FloatArray, problem: BundleProblem, camera: Camera, prior: ParameterPrior, t_s: FloatArray
) -> float:
    """Return the log of how much likelier the pictures alone are with a change (K,) than with none.

    Args:
        log_ratio: At the knots of :func:`focal_equations`.
        problem, camera, prior, t_s: As there.

    Raises:
        NotPositiveDefiniteError: The pictures do not determine the poses.
    """
    return focal_equations(of_pictures_alone(problem), camera, prior, t_s).gain(log_ratio)


def changes_of(equations: FocalEquations, log_ratio: FloatArray, camera: Camera) -> FocalChanges:
    """Return changes with these logarithms (K,), about the principal point."""
    centre_px = float(camera.cx), float(camera.cy)
    return FocalChanges(tuple(equations.t_s.tolist()), tuple(log_ratio.tolist()), centre_px)


def without_change(uv_px: FloatArray, camera: Camera, log_ratio: FloatArray) -> FloatArray:
    """Return undistorted pixels (N, 2) as they were without changes (N,) of log focal length.

    Where the lens model has no inverse they do not change.
    """
    centre = np.array([camera.cx, camera.cy])
    seen = distort(camera, uv_px)
    new = undistort(camera, centre + (seen - centre) * np.exp(-log_ratio)[:, None])
    return np.where(np.isfinite(new), new, uv_px)
