"""Control points: their observations in the world frame, and the poses of frames that show enough."""

import cv2
import numpy as np

from vgps.camera import undistort
from vgps.geodesy import to_enu
from vgps.mapping.control_observations import ControlObservations
from vgps.model import Camera, ControlPoints, FloatArray, GeodeticPoint
from vgps.tracking.pose import Correspondences, refine_pose

_MIN_POINTS = 4  # three leave several poses


def world_controls(
    points: ControlPoints | None, camera: Camera, origin: GeodeticPoint | None
) -> ControlObservations | None:
    """Return the undistorted observations of control points in the world, without those outside the lens.

    Check points are left out: they judge the result.

    Args:
        points: Control points as read, or None.
        camera: Camera that observed them.
        origin: Origin of the world frame; needed if the points are geodetic.
    """
    if points is None:
        return None
    world = points.world_p_point
    if points.geodetic and origin is not None:
        world = to_enu(origin, *world.T)
    uv = undistort(camera, points.uv_px)
    valid = np.isfinite(uv).all(axis=1) & ~points.check
    _, mark, views = np.unique(np.array(points.name)[valid], return_inverse=True, return_counts=True)
    sigma = points.sigma_m[valid] * np.sqrt(views[mark])[:, None]
    return ControlObservations(points.frame[valid], uv[valid], world[valid], sigma)


def control_poses(controls: ControlObservations, K: FloatArray) -> dict[int, FloatArray]:
    """Return the pose (4, 4) of every frame with four or more control points, by Eq. (18) over them alone."""
    poses = {}
    for frame in np.unique(controls.frame).tolist():
        rows = controls.frame == frame
        if rows.sum() < _MIN_POINTS:
            continue
        matches = Correspondences(controls.world_p_point[rows], controls.uv_px[rows])
        solved, rotation, translation = cv2.solvePnP(
            matches.points, matches.uv_px, K, None, flags=cv2.SOLVEPNP_SQPNP
        )
        if not solved:
            continue
        R = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
        start = np.eye(4)
        start[:3, :3], start[:3, 3] = R.T, -R.T @ np.asarray(translation, dtype=np.float64)[:, 0]
        poses[frame], _ = refine_pose(K, start, matches, np.ones(len(matches)))
    return poses
