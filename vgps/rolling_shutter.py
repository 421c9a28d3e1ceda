"""The poses from which a rolling shutter took its rows, on the path through the frames."""

from factors import poses_at
from vgps.camera import row_shares
from vgps.model import Camera, FloatArray, IntArray


def row_poses(
    camera: Camera, t_s: FloatArray, world_T_camera: FloatArray, frame: IntArray, uv_px: FloatArray
) -> FloatArray:
    """Return the pose (N, 4, 4) from which each observation was made: that of its row.

    Args:
        camera: The camera; with a global shutter the poses are those of the frames.
        t_s: (F,) times of all frames.
        world_T_camera: (F, 4, 4) their poses, of their middle rows.
        frame: (N,) frame of each observation.
        uv_px: (N, 2) undistorted pixels.
    """
    if not camera.readout_s or len(t_s) < 2:
        return world_T_camera[frame]
    at_s = t_s[frame] + camera.readout_s * row_shares(camera, uv_px)
    return poses_at(t_s, world_T_camera, at_s)
