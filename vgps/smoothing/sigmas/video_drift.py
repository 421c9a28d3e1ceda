"""Drift of the video as a source of errors: deformations of the path that leave no residuals in tracks."""

from collections.abc import Callable

import numpy as np

from vgps.config import DriftConfig
from vgps.geometry import cross_matrices
from vgps.model import FloatArray
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem

# The video drifts less than verdicts on fixes allow for. From one knot to the next, stage D without fixes
# changes log scale by 0.010 and 0.012 (kitti03, kitti07; simulated walk 0.003) and turns about each axis by
# 0.04 and 0.06 degrees (0.004), where the settings expect 0.05 and 0.3 degrees; its changes have heavy tails.
_DRIFT_SHARE = 0.3
_DRAWS, _SEED = 30, 0  # of what the IMU would show


def drift_draws(
    problem: BundleProblem,
    structure: SparsityStructure,
    config: DriftConfig | None,
    draws: int,
    rng: np.random.Generator,
) -> FloatArray:
    """Return deformations (6 n_free, K) of the path by a drift of the video, in the poses' tangents.

    Log scale and rotation walk at random from knot to knot, as in :mod:`vgps.gps.drift_model`.
    """
    total = np.zeros((structure.n_free, POSE_DIM, draws))
    if config is None:
        return total.reshape(-1, draws)
    frames = np.arange(len(problem.world_T_camera))
    rotation = np.radians(config.rotation_sigma_deg)
    sigma = _DRIFT_SHARE * np.array([config.scale_sigma, rotation, rotation, rotation])
    knots = np.cumsum(rng.normal(size=(2 + len(frames) // config.knot_frames, 4, draws)), axis=0)
    at = frames / config.knot_frames
    before, share = at.astype(int), (at - at.astype(int))[:, None, None]
    walk = sigma[:, None] * ((1.0 - share) * knots[before] + share * knots[before + 1])
    steps = np.diff(problem.world_T_camera[:, :3, 3], axis=0)
    moved = steps[:, :, None] * walk[:-1, :1] - cross_matrices(steps) @ walk[:-1, 1:]
    position = np.concatenate([np.zeros((1, 3, draws)), np.cumsum(moved, axis=0)])
    world = np.stack([walk[:, 1:], position], axis=1)  # (F, 2, 3, K)
    camera_R_world = problem.world_T_camera[:, None, :3, :3].swapaxes(-1, -2)
    free = structure.free >= 0
    total[structure.free[free]] = (camera_R_world @ world)[free].reshape(-1, POSE_DIM, draws)
    return total.reshape(-1, draws)


def moved_poses(problem: BundleProblem, structure: SparsityStructure, moved_m: FloatArray) -> FloatArray:
    """Return the movement (6 n_free,) of poses by vectors (F, 3) in the world, in the poses' tangents."""
    total = np.zeros((structure.n_free, POSE_DIM))
    free = structure.free >= 0
    in_camera = np.einsum("fji,fj->fi", problem.world_T_camera[:, :3, :3], moved_m)
    total[structure.free[free], 3:] = in_camera[free]
    return total.ravel()


def drift_by_imu(
    problem: BundleProblem,
    structure: SparsityStructure,
    config: DriftConfig,
    residual: FloatArray,
    disagreement: Callable[[FloatArray], FloatArray],
) -> DriftConfig:
    """Return the drift of scale and of rotation, no larger than an IMU's residuals show them to be.

    A drift of the expected size would leave residuals of some size in the IMU's factors. Where theirs are
    smaller, the drift is. It is an upper bound: their residuals have other reasons beside it.

    Args:
        problem: At its optimum.
        structure: Its structure.
        config: Drift that the settings expect.
        residual: (M,) whitened residuals of the IMU's factors.
        disagreement: Whitened residuals (M, K) of deformations (6 n_free, K), after the optimum followed.
    """
    rng, shown = np.random.default_rng(_SEED), {}
    for name, other in (("scale_sigma", "rotation_sigma_deg"), ("rotation_sigma_deg", "scale_sigma")):
        alone = config.model_copy(update={other: 0.0})
        expected = disagreement(drift_draws(problem, structure, alone, _DRAWS, rng))
        ratio = float(np.sum(residual**2) / max(np.sum(expected**2) / _DRAWS, 1e-12))
        shown[name] = getattr(config, name) * min(1.0, ratio) ** 0.5
    return config.model_copy(update=shown)
