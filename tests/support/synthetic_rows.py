"""Bundle problems of a rolling shutter with a known truth."""

from dataclasses import replace

import numpy as np
from synthetic_bundle import K, drive

from vgps.model import FloatArray
from vgps.solver.problem import BundleProblem
from vgps.solver.row_times import RowTimes

ROWS = 480


def rolling_drive(
    readout_s: float = 0.06, noise_px: float = 0.5, **scene: float
) -> tuple[BundleProblem, FloatArray]:
    """Return a drive observed by a rolling shutter, and its true poses; frames come every 0.1 s, roughly.

    The drive's own observations give the rows; what the path shows there are the new observations.
    """
    problem, poses = drive(**scene)  # type: ignore[arg-type]
    t_s = 0.1 * np.arange(len(poses)) + 0.004 * np.sin(np.arange(len(poses)))
    share = np.clip(problem.uv_px[:, 1] / (ROWS - 1.0) - 0.5, -0.5, 0.5)
    times = RowTimes.of_frames(t_s, problem.frame, share, readout_s)
    true_points = drive(**{**scene, "disturbed": 0.0})[0].world_p_landmark  # type: ignore[arg-type]
    at = times.poses(poses)
    p = np.einsum("nji,nj->ni", at[:, :3, :3], true_points[problem.landmark] - at[:, :3, 3])
    uv = np.stack([K[0] * p[:, 0] / p[:, 2] + K[2], K[1] * p[:, 1] / p[:, 2] + K[3]], axis=1)
    noise = np.random.default_rng(7).normal(0.0, noise_px, uv.shape) if noise_px else 0.0
    return replace(problem, uv_px=uv + noise, row_times=times), poses


def path_error(poses: FloatArray, truth: FloatArray) -> float:
    """Return the RMS distance of the positions."""
    return float(np.sqrt(np.mean(np.sum((poses[:, :3, 3] - truth[:, :3, 3]) ** 2, axis=1))))
