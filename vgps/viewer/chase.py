"""A second camera that flies behind and above the first, for a view of what is around it."""

import numpy as np
import rerun as rr
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from vgps.model import FloatArray
from vgps.solution import Solution
from vgps.viewer.columns import Sheet

CHASE = "world/chase"
_BEHIND, _ABOVE, _AHEAD = 5.0, 3.5, 3.0  # in units of chase_size_m
_CALM_S = 1.0  # turns are smoothed over this time: a hand-held camera shakes


def log_chase(sheet: Sheet, solution: Solution) -> None:
    """Log the flying camera; its own frame is not drawn."""
    centres, rotations = chase_poses(solution)
    quaternions = Rotation.from_matrix(rotations).as_quat()
    sheet.at_frames(CHASE, rr.Transform3D.columns(translation=centres, quaternion=quaternions))
    sheet.static(
        CHASE,
        rr.Pinhole(
            fov_y=0.9,
            aspect_ratio=1.0,
            camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=1e-3,
            color=(0, 0, 0, 0),
            line_width=0.0,
        ),
    )


def chase_poses(solution: Solution) -> tuple[FloatArray, FloatArray]:
    """(F, 3) where the flying camera is, and (F, 3, 3) world_R_chase, level, x right, y down, z forward."""
    poses, size = solution.world_T_camera, chase_size_m(solution)
    calm = max(1, round(_CALM_S * len(poses) / max(float(np.ptp(solution.t_s)), 1e-9)))
    # a camera that looks straight up or down is followed along the top of its picture
    ahead = poses[:, :3, 2] - np.where(np.abs(poses[:, 2:3, 2]) > 0.9, 1.0, 0.0) * poses[:, :3, 1]
    ahead = _unit(uniform_filter1d(ahead * (1.0, 1.0, 0.0), calm, axis=0, mode="nearest"))
    up = np.array([0.0, 0.0, 1.0])
    centres = poses[:, :3, 3] - _BEHIND * size * ahead + _ABOVE * size * up
    forward = _unit(poses[:, :3, 3] + _AHEAD * size * ahead - centres)
    right = _unit(np.cross(forward, up))
    return centres, np.stack([right, np.cross(forward, right), forward], axis=-1)


def chase_size_m(solution: Solution) -> float:
    """A length that fits the surroundings of the camera: a second of its way, within 0.3 to 5 m."""
    way = np.linalg.norm(np.diff(solution.world_T_camera[:, :3, 3], axis=0), axis=1).sum()
    return float(np.clip(way / max(float(np.ptp(solution.t_s)), 1e-9), 0.3, 5.0))


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), np.array([0.0, 1.0, 0.0]))
