"""Least-squares alignment of two sets of points."""

import numpy as np

from vgps.model import FloatArray


def align(source: FloatArray, target: FloatArray, *, with_scale: bool) -> tuple[float, FloatArray] | None:
    """Align points to others by the rigid motion or similarity of least squares; Umeyama 1991.

    Args:
        source, target: (N, 3) corresponding points [m].
        with_scale: Estimate a scale (Sim(3)); otherwise it is 1 (SE(3)).

    Returns:
        The scale and the (N, 3) errors that remain, aligned source minus target; None if the points do not
        determine the alignment: fewer than three, or all the same.
    """
    p, q = source - source.mean(axis=0), target - target.mean(axis=0)
    variance = float((p**2).sum())
    if len(p) < 3 or variance < 1e-12 * len(p):
        return None
    U, singular, Vt = np.linalg.svd(q.T @ p)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    rotation = (U * sign) @ Vt
    scale = float(singular @ sign) / variance if with_scale else 1.0
    return scale, scale * p @ rotation.T - q
