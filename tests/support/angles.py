"""The angle between two rotations, by which tests compare poses."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.model import FloatArray


def apart_deg(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angles (...) between rotations (..., 3, 3) or poses (..., 4, 4), degrees."""
    return np.degrees(Rotation.from_matrix(np.swapaxes(a[..., :3, :3], -1, -2) @ b[..., :3, :3]).magnitude())
