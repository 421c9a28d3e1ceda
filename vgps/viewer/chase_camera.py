"""A virtual camera behind and above the real one, for a view of its surroundings."""

import numpy as np
import rerun as rr
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from vgps.model import FloatArray
from vgps.solution import Trajectory
from vgps.viewer.run_stream import RunStream

CHASE = "world/chase"
_BEHIND, _ABOVE, _AHEAD = 5.0, 3.5, 3.0  # in units of chase_scale_m
_SMOOTHING_S = 1.0  # headings are averaged over this time: a hand-held camera shakes
_STEEP = 0.9  # z component of the optical axis beyond which it gives no heading


def log_chase_camera(stream: RunStream, trajectory: Trajectory) -> None:
    """Log the chase camera; its own frustum is not drawn."""
    centres, rotations = chase_poses(trajectory)
    quaternions = Rotation.from_matrix(rotations).as_quat()
    stream.send_frames(CHASE, rr.Transform3D.columns(translation=centres, quaternion=quaternions))
    stream.log_static(
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


def chase_poses(trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Return the chase camera's centres (F, 3) [m] and level rotations (F, 3, 3) world_R_chase."""
    poses, scale = trajectory.world_T_camera, chase_scale_m(trajectory)
    frames = max(1, round(_SMOOTHING_S * len(poses) / max(float(np.ptp(trajectory.t_s)), 1e-9)))
    # a camera that looks straight up or down is followed along the top of its picture
    ahead = poses[:, :3, 2] - np.where(np.abs(poses[:, 2:3, 2]) > _STEEP, 1.0, 0.0) * poses[:, :3, 1]
    ahead = _unit(uniform_filter1d(ahead * (1.0, 1.0, 0.0), frames, axis=0, mode="nearest"))
    up = np.array([0.0, 0.0, 1.0])
    centres = poses[:, :3, 3] - _BEHIND * scale * ahead + _ABOVE * scale * up
    forward = _unit(poses[:, :3, 3] + _AHEAD * scale * ahead - centres)
    right = _unit(np.cross(forward, up))
    return centres, np.stack([right, np.cross(forward, right), forward], axis=-1)


def chase_scale_m(trajectory: Trajectory) -> float:
    """Return the distance that the camera covers in a second on average, within 0.3 to 5 m."""
    return float(np.clip(trajectory.length_m / max(float(np.ptp(trajectory.t_s)), 1e-9), 0.3, 5.0))


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-9, vectors / np.maximum(length, 1e-9), np.array([0.0, 1.0, 0.0]))
