"""A rolling shutter in stage A: features belong to their rows' times, poses to the middle row's."""

import numpy as np

from factors import poses_at
from vgps.camera import row_shares
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
    middle, _ = _projected(camera, world_T_camera[None], points)
    at_s = row_shares(camera, middle) * (camera.readout_s or 0.0)
    knot_s = np.array([-interval_s, 0.0])
    rows = poses_at(knot_s, np.stack([newest, world_T_camera]), at_s, np.zeros(len(at_s), np.int64))
    seen, depth = _projected(camera, rows, points)
    return np.where((depth > _MIN_DEPTH)[:, None], np.nan_to_num(seen - middle), 0.0)


def _projected(
    camera: Camera, world_T_camera: FloatArray, points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return pixels (N, 2) and depths (N,) of points (N, 3) in one or in N cameras."""
    R, centre = world_T_camera[:, :3, :3], world_T_camera[:, :3, 3]
    p = ((points - centre)[:, None, :] @ R)[:, 0]
    depth = np.where(p[:, 2] > _MIN_DEPTH, p[:, 2], np.nan)
    uv = p[:, :2] / depth[:, None] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    return uv, np.nan_to_num(depth)
