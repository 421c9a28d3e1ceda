"""A rolling shutter in stage A: features belong to their rows' times, poses to the middle row's."""

import numpy as np

from factors import knots_around, path_weights, poses_at
from vgps.camera import row_shares
from vgps.geometry import project
from vgps.model import Camera, FloatArray

_MIN_DEPTH = 1e-3  # map units; points nearer than this are not shifted
_PASSES = 2  # the second takes the row in which the first sees a point


def row_shifts(
    camera: Camera, knot_s: FloatArray, knots: FloatArray, world_T_camera: FloatArray, points: FloatArray
) -> FloatArray:
    """Return how far points (N, 3) are seen from where the pose of the middle row shows them, (N, 2) pixels.

    Pixels are those of the undistorted image.

    Args:
        camera: A camera with a readout.
        knot_s: (K,) times from which the path is drawn, since that of the middle row.
        knots: (K, 4, 4) poses at these times.
        world_T_camera: (4, 4) pose of the frame.
        points: Points, NaN where unknown; these are not shifted.
    """
    middle, middle_depth = project(camera.K, world_T_camera, points)
    shift = np.zeros_like(middle)
    for _ in range(_PASSES):
        rows = poses_at(knot_s, knots, row_shares(camera, middle + shift) * (camera.readout_s or 0.0))
        seen, depth = project(camera.K, rows, points[:, None])  # each point in its own camera
        ahead = (middle_depth > _MIN_DEPTH) & (depth[:, 0] > _MIN_DEPTH)
        shift = np.where(ahead[:, None], seen[:, 0] - middle, 0.0)
    return shift


def at_middle_rows(camera: Camera, t_s: FloatArray, uv_px: FloatArray) -> FloatArray:
    """Return where tracks (N, V, 2) were at the times of their views' middle rows, undistorted pixels.

    No pose is needed: the observations of a track, each at its row's time, are interpolated as poses are
    (:mod:`factors.continuous_path`). In the first and the last view half of them are extrapolated.

    Args:
        camera: A camera with a readout.
        t_s: (V,) times of the views.
        uv_px: (N, V, 2) undistorted pixels, NaN where unknown.
    """
    n, views, _ = uv_px.shape
    shares = row_shares(camera, uv_px.reshape(-1, 2)).reshape(n, views)
    row_s = t_s + (camera.readout_s or 0.0) * shares
    track, view = (index.ravel() for index in np.indices((n, views)))
    knots = knots_around(t_s, view - (row_s > t_s)[track, view])
    weights, _ = path_weights(row_s[track[:, None], knots], t_s[view])
    middle = np.einsum("nk,nkd->nd", weights, uv_px[track[:, None], knots])
    return np.asarray(middle.reshape(n, views, 2))
