"""A rolling shutter in stage A: features belong to their rows' times, poses to the middle row's."""

import numpy as np

from factors import poses_at
from vgps.camera import row_shares
from vgps.geometry import project
from vgps.model import Camera, FloatArray

_MIN_DEPTH = 1e-3  # map units; points nearer than this are not shifted


def row_shifts(
    camera: Camera, interval_s: float, newest: FloatArray, world_T_camera: FloatArray, points: FloatArray
) -> FloatArray:
    """Return how far points (N, 3) are seen from where the pose of the middle row shows them, (N, 2) pixels.

    The camera moves on as it did since the newest view. Pixels are those of the undistorted image.

    Args:
        camera: A camera with a readout.
        interval_s: Time since the newest view.
        newest: (4, 4) pose of that view.
        world_T_camera: (4, 4) pose of the frame.
        points: Points, NaN where unknown; these are not shifted.
    """
    middle, middle_depth = project(camera.K, world_T_camera, points)
    at_s = row_shares(camera, middle) * (camera.readout_s or 0.0)
    knot_s = np.array([-interval_s, 0.0])
    rows = poses_at(knot_s, np.stack([newest, world_T_camera]), at_s, np.zeros(len(at_s), np.int64))
    seen, depth = project(camera.K, rows, points[:, None])  # each point in its own camera
    ahead = (middle_depth > _MIN_DEPTH) & (depth[:, 0] > _MIN_DEPTH)
    return np.where(ahead[:, None], seen[:, 0] - middle, 0.0)
