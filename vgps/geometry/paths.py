"""Distances along paths."""

import numpy as np

from vgps.model import FloatArray


def travelled(centres: FloatArray) -> FloatArray:
    """Return the length (N,) of a path of centres (N, 3) up to each of them."""
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    return np.concatenate([np.zeros(min(1, len(centres))), np.cumsum(steps)])
