"""How fast frames turn beyond the path: motion faster than the frames, which the rows of each frame show.

The path through the frames (:mod:`factors.continuous_path`) misses what is faster than they are: of a hand
that shakes, with a readout of 30 ms and 620 px of focal length, 0.15 px at 30 frames/s and 0.36 px at 15 (RMS
over the rows). But all observations of a frame see one motion, of which a constant angular rate leaves 0.05
and 0.08 px. So each frame has such a rate beside the path's, by which its observations are turned back.
"""

from dataclasses import replace

import numpy as np

from vgps.geometry import MIN_DEPTH, in_picture
from vgps.model import FloatArray, IntArray
from vgps.solver.cost import camera_points, pixel_errors, robust_weight
from vgps.solver.problem import BundleProblem

_PASSES = 2  # the second weighs what the first leaves
_ITERATIONS = 10  # of the rates' prior
_MIN_OBSERVATIONS = 10  # of a frame, for the 9 unknowns of its pose and rate
_DAMPING = 1e-9  # relative, of a frame's pose
_MIN_VARIANCE = 1e-12  # of rates and pixels without errors


def turned_back(problem: BundleProblem, rates: FloatArray | None) -> BundleProblem:
    """Return the problem with observations as they would be if the frames turned with the path alone.

    Args:
        problem: With the observations as seen.
        rates: (F, 3) angular rates beyond the path, rad/s about the camera's axes; None for none.
    """
    times = problem.row_times
    if rates is None or times is None:
        return problem
    turn = (times.readout_s * times.share)[:, None] * rates[problem.frame]
    return replace(problem, uv_px=problem.uv_px - np.einsum("nij,nj->ni", _by_rotation(problem), turn))


def frame_rates(problem: BundleProblem, before: FloatArray | None) -> FloatArray:
    """Return the angular rates (F, 3) of frames beyond the path, rad/s, that the residuals show.

    Pose and rate of each frame are fitted together to its residuals, the landmarks held. The prior of the
    rates is normal about zero, with the variances that make them most likely (empirical Bayes by expectation
    maximisation, Dempster, Laird and Rubin 1977). Frames of few observations get none.

    Args:
        problem: Of a rolling shutter, at its optimum; its observations are turned back by ``before``.
        before: (F, 3) rates so far; None for none.
    """
    times, frame = problem.row_times, problem.frame
    rates = np.zeros((len(problem.world_T_camera), 3)) if before is None else before
    shown = np.flatnonzero(np.bincount(frame, minlength=len(rates)) >= _MIN_OBSERVATIONS)
    if times is None or not len(shown):
        return np.zeros_like(rates)
    camera_p = camera_points(problem)
    error, behind = pixel_errors(problem, camera_p)
    by_rotation = _by_rotation(problem)
    by_rate = (times.readout_s * times.share)[:, None, None] * by_rotation
    jacobian = np.concatenate([by_rate, by_rotation, _by_translation(problem, camera_p)], axis=2)
    jacobian = in_picture(problem.lens, jacobian.transpose(1, 2, 0)).transpose(2, 0, 1)
    by_rate = jacobian[:, :, :3]
    residual = error.T - np.einsum("nij,nj->ni", by_rate, rates[frame])
    for _ in range(_PASSES):
        left = np.sum((residual + np.einsum("nij,nj->ni", by_rate, rates[frame])) ** 2, axis=1)
        weight = robust_weight(problem, left / problem.sigma_px**2) * ~behind
        variance_px = 0.5 * np.sum(weight * left) / max(np.sum(weight), 1.0)
        weight = weight / max(float(variance_px), _MIN_VARIANCE)
        matrix, right = _normal_equations(jacobian, residual, weight, frame)
        rates = np.zeros_like(rates)
        rates[shown] = _most_likely(*_without_poses(matrix[shown], right[shown]))
    return rates


def _by_rotation(problem: BundleProblem) -> FloatArray:
    """Return the derivatives (N, 2, 3) of the observed pixels by a rotation of the camera about its axes."""
    focal_px, centre_px = np.array(problem.K).reshape(2, 2)
    a, b = ((problem.uv_px - centre_px) / focal_px).T
    rows = np.array([[a * b, -1.0 - a * a, b], [1.0 + b * b, -a * b, -a]])
    return np.asarray(focal_px[:, None] * rows.transpose(2, 0, 1))


def _by_translation(problem: BundleProblem, camera_p: FloatArray) -> FloatArray:
    """Return the derivatives (N, 2, 3) of pixels by translations along the camera's axes.

    Args:
        problem: Gives the focal lengths.
        camera_p: (3, N) landmarks in the camera frame.
    """
    inverse = 1.0 / np.maximum(camera_p[2], MIN_DEPTH)
    a, b = camera_p[:2] * inverse
    zero = np.zeros_like(inverse)
    rows = np.array([[-inverse, zero, a * inverse], [zero, -inverse, b * inverse]])
    return np.asarray(np.array(problem.K[:2])[:, None] * rows.transpose(2, 0, 1))


def _normal_equations(
    jacobian: FloatArray, residual: FloatArray, weight: FloatArray, frame: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the matrices (F, k, k) and right sides (F, k) of the frames up to the last one observed."""
    weighted = weight[:, None, None] * jacobian
    order = np.argsort(frame, kind="stable")
    seen, start = np.unique(frame[order], return_index=True)
    k, frames = jacobian.shape[2], int(frame.max()) + 1
    matrix, right = np.zeros((frames, k, k)), np.zeros((frames, k))
    matrix[seen] = np.add.reduceat((weighted.transpose(0, 2, 1) @ jacobian)[order], start)
    right[seen] = -np.add.reduceat(np.einsum("nij,ni->nj", weighted, residual)[order], start)
    return matrix, right


def _without_poses(matrix: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the information (n, 3, 3) and right sides (n, 3) of the rates, the poses eliminated."""
    pose = matrix[:, 3:, 3:]
    pose = pose + _DAMPING * np.eye(6) * np.trace(pose, axis1=1, axis2=2)[:, None, None]
    gain = np.linalg.solve(pose, np.concatenate([matrix[:, 3:, :3], right[:, 3:, None]], axis=2))
    across = matrix[:, :3, 3:] @ gain
    return matrix[:, :3, :3] - across[..., :3], right[:, :3] - across[..., 3]


def _most_likely(information: FloatArray, right: FloatArray) -> FloatArray:
    """Return the rates (n, 3) with the prior that makes them most likely."""
    variance = np.ones(3)
    for _ in range(_ITERATIONS):
        covariance = np.linalg.inv(information + np.diag(1.0 / variance))
        mean = np.einsum("nij,nj->ni", covariance, right)
        spread = mean**2 + np.diagonal(covariance, axis1=1, axis2=2)
        variance = np.maximum(spread.mean(axis=0), _MIN_VARIANCE)
    return np.asarray(mean)
