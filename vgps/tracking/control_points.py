"""Points of known position: poses of the frames that show enough of them, the thesis's way to begin."""

import cv2
import numpy as np

from vgps.camera import undistort
from vgps.geodesy import to_enu
from vgps.mapping.control_observations import ControlObservations
from vgps.model import Camera, ControlPoints, FloatArray, GeodeticPoint
from vgps.tracking.pose import refine_pose

_MIN_POINTS = 4


def world_controls(
    points: ControlPoints | None, camera: Camera, origin: GeodeticPoint | None
) -> ControlObservations | None:
    """The observations, undistorted, in the world frame; those that the lens cannot have seen are left out.

    Args:
        points: As read, or nothing.
        camera: Its lens.
        origin: Of the world frame; needed if the points are geodetic.
    """
    if points is None:
        return None
    world = points.world_p_point
    if points.geodetic and origin is not None:
        world = to_enu(origin, *world.T)
    uv = undistort(camera, points.uv_px)
    seen = np.isfinite(uv).all(axis=1)
    return ControlObservations(points.frame[seen], uv[seen], world[seen])


def control_poses(controls: ControlObservations, K: FloatArray) -> dict[int, FloatArray]:
    """Pose (4, 4) of every frame with four or more control points, by (18) over them alone."""
    poses = {}
    for frame in np.unique(controls.frame).tolist():
        rows = controls.frame == frame
        if rows.sum() < _MIN_POINTS:
            continue
        points, uv = controls.world_p_point[rows], controls.uv_px[rows]
        found, rotation, translation = cv2.solvePnP(points, uv, K, None, flags=cv2.SOLVEPNP_SQPNP)
        if not found:
            continue
        R = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
        start = np.eye(4)
        start[:3, :3], start[:3, 3] = R.T, -R.T @ np.asarray(translation, dtype=np.float64)[:, 0]
        poses[frame], _ = refine_pose(K, start, points, uv, np.ones(len(points)))
    return poses
