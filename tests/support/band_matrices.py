"""Random band matrices over poses."""

import numpy as np

from vgps.solver.matrices.band_matrix import POSE_DIM


def random_matrix(poses: int, reach: int, seed: int) -> np.ndarray:
    """Return a positive definite (6 poses, 6 poses) matrix that couples poses up to ``reach`` apart."""
    rng = np.random.default_rng(seed)
    n = POSE_DIM * poses
    A = rng.normal(size=(n, n))
    apart = (
        np.abs(np.subtract.outer(np.arange(poses), np.arange(poses))).repeat(POSE_DIM, 0).repeat(POSE_DIM, 1)
    )
    A[apart > reach] = 0.0
    A = A + A.T
    return A + np.diag(np.abs(A).sum(axis=1) + 0.1)
