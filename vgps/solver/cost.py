"""The cost of a bundle problem: reprojection errors, robust losses, and the error of the pose factors."""

from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

import numpy as np

from vgps.geometry import in_picture
from vgps.model import BoolArray, FloatArray
from vgps.runtime.threads import map_in_order
from vgps.solver.disk_arrays import DiskArrays
from vgps.solver.gtsam_values import pose_values
from vgps.solver.problem import BundleProblem

Result = TypeVar("Result")

_AT_ONCE = 2**16  # observations
_BYTES = 48  # of one: frame, landmark, pixels, sigma, constant of the loss


def whitened_robust_k(k: float, pixel_sigma_px: FloatArray, sigma_px: FloatArray) -> FloatArray:
    """Return the loss constants that make a loss act on the pixel error, before the 1/|P_i| weighting.

    The loss is to compare ``|e| / pixel_sigma_px`` with ``k``, but the solver compares ``|e| / sigma_px``
    with the constant; so the constant is ``k * pixel_sigma_px / sigma_px``.

    Args:
        k: Constant for errors in units of ``pixel_sigma_px``.
        pixel_sigma_px: (N,) sigma of the measurement itself, pixels.
        sigma_px: (N,) sigma in the cost.
    """
    return k * pixel_sigma_px / sigma_px


def robust_loss(problem: BundleProblem, squared: FloatArray) -> FloatArray:
    """Return the loss rho of each observation, as GTSAM's ``mEstimator.Huber`` and ``Cauchy`` define it.

    Args:
        problem: Gives the loss and its constants.
        squared: (N,) squared whitened errors.
    """
    loss = 0.5 * squared
    if problem.robust == "none" or problem.robust_k is None:
        return loss
    k = problem.robust_k
    if problem.robust == "huber":
        beyond = squared > k * k
        loss[beyond] = k[beyond] * (np.sqrt(squared[beyond]) - 0.5 * k[beyond])
    else:
        finite = np.isfinite(k)
        k2 = k[finite] ** 2
        loss[finite] = 0.5 * k2 * np.log1p(squared[finite] / k2)
    return loss


def robust_weight(problem: BundleProblem, squared: FloatArray) -> FloatArray:
    """Return the weight rho'(e) / e of each observation in iteratively reweighted least squares.

    Args:
        problem: Gives the loss and its constants.
        squared: (N,) squared whitened errors.
    """
    weight = np.ones_like(squared)
    if problem.robust == "none" or problem.robust_k is None:
        return weight
    k = problem.robust_k
    if problem.robust == "huber":
        beyond = squared > k * k
        weight[beyond] = k[beyond] / np.sqrt(squared[beyond])
    else:
        finite = np.isfinite(k)
        weight[finite] = 1.0 / (1.0 + squared[finite] / k[finite] ** 2)
    return weight


def view_poses(problem: BundleProblem) -> FloatArray:
    """Return the first three rows of world_T_camera of each observation's view, (3, 4, N)."""
    problem = problem.by_view()
    frame = problem.frame
    first, last = (int(frame.min()), int(frame.max())) if len(frame) else (0, 0)
    rows = problem.world_T_camera[first : last + 1, :3].transpose(1, 2, 0)
    return np.ascontiguousarray(rows).take(frame - first, axis=2)


def camera_points(problem: BundleProblem, views: FloatArray | None = None) -> FloatArray:
    """Return the landmark of each observation in the camera frame of its view, (3, N) metres.

    Args:
        problem: The observations.
        views: (3, 4, N) from :func:`view_poses`, where they are at hand.
    """
    T = view_poses(problem) if views is None else views
    x, y, z = (problem.world_p_landmark[:, i][problem.landmark] - T[i, 3] for i in range(3))
    return np.stack([T[0, j] * x + T[1, j] * y + T[2, j] * z for j in range(3)])


def pixel_errors(problem: BundleProblem, camera_p: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return projected minus observed pixels (2, N) of the picture, and (N,) which lie behind the camera.

    As in GTSAM, a landmark behind the camera has a constant error: twice fx in both undistorted coordinates.

    Args:
        problem: The observations.
        camera_p: (3, N) from :func:`camera_points`.
    """
    fx, fy, cx, cy = problem.intrinsics
    x, y, z = camera_p
    behind = z <= 0.0
    depth = np.where(behind, 1.0, z)
    errors = np.stack(
        [fx * x / depth + (cx - problem.uv_px[:, 0]), fy * y / depth + (cy - problem.uv_px[:, 1])]
    )
    errors[:, behind] = 2.0 * np.broadcast_to(fx, behind.shape)[behind]
    return in_picture(problem.lens, errors), behind


def reprojection_errors(problem: BundleProblem) -> tuple[FloatArray, BoolArray]:
    """Return projected minus observed pixels (N, 2), and (N,) which landmarks lie behind the camera."""
    errors, behind = np.empty((len(problem.frame), 2)), np.empty(len(problem.frame), dtype=bool)
    for rows, (found, hidden) in _in_parts(lambda part: pixel_errors(part, camera_points(part)), problem):
        errors[rows], behind[rows] = found.T, hidden
    return errors, behind


def observation_costs(problem: BundleProblem, views: FloatArray | None = None) -> FloatArray:
    """Return the cost of each observation (N,); arguments as for :func:`camera_points`."""
    if views is not None:
        return _costs(problem, views)
    costs = np.empty(len(problem.frame))
    for rows, part in _in_parts(_costs, problem):
        costs[rows] = part
    return costs


def _costs(problem: BundleProblem, views: FloatArray | None = None) -> FloatArray:
    errors, _ = pixel_errors(problem, camera_points(problem, views))
    return robust_loss(problem, np.sum(errors**2, axis=0) / problem.sigma_px**2)


def _in_parts(
    function: Callable[[BundleProblem], Result], problem: BundleProblem
) -> Iterator[tuple[slice, Result]]:
    """Yield rows and a function of the observations, of a part at a time for the sake of memory."""
    count = len(problem.frame)
    if count <= _AT_ONCE:
        yield slice(None), function(problem)
        return
    parts = [slice(begin, min(begin + _AT_ONCE, count)) for begin in range(0, count, _AT_ONCE)]

    def of_part(rows: slice) -> Result:
        return function(problem.select_observations(np.arange(rows.start, rows.stop)))

    for rows, result in zip(parts, map_in_order(of_part, parts), strict=True):
        yield rows, result
        DiskArrays.passed((rows.stop - rows.start) * _BYTES)


def video_cost(problem: BundleProblem) -> float:
    """Return the cost of all observations, the sum of Phi_i of Eq. (12), Kume 2010."""
    return float(np.sum(observation_costs(problem)))


def cost_terms(problem: BundleProblem) -> Mapping[str, float]:
    """Return the terms of Eq. (11), Kume 2010: ``video`` (observations) and ``poses`` (pose factors)."""
    return {"video": video_cost(problem), "poses": float(problem.pose_graph.error(pose_values(problem)))}
