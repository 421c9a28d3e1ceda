"""Times of the rows in which observations lie, for a camera with a rolling shutter."""

from vgps.camera import row_shares
from vgps.model import Camera, FloatArray, IntArray
from vgps.solver.row_times import RowTimes


def row_times(t_s: FloatArray, frame: IntArray, uv_px: FloatArray, camera: Camera) -> RowTimes | None:
    """Return the times of observations (N, 2) in some frames (N,); None for a global shutter.

    Args:
        t_s: (F,) times of all frames.
        frame: (N,) frame of each observation.
        uv_px: (N, 2) undistorted pixels.
        camera: The camera.
    """
    if not camera.readout_s or len(t_s) < 2:
        return None
    return RowTimes.of_frames(t_s, frame, row_shares(camera, uv_px), camera.readout_s)
