"""Refusal of frames that cannot belong to a live video."""

import numpy as np

from vgps.errors import VideoError
from vgps.model import Camera, FloatArray, GrayImage


def check_frame(camera: Camera, before_s: FloatArray, t_s: float, image: GrayImage) -> None:
    """Check the next frame.

    Args:
        camera: Of the video.
        before_s: (F,) times of the frames before it.
        t_s: Its time.
        image: (H, W) its luminance.

    Raises:
        VideoError: The size differs from the camera's, or the time is not later than the last.
    """
    frame, size = len(before_s), (camera.height, camera.width)
    if image.shape != size or image.dtype != np.uint8:
        raise VideoError(
            f"a picture of shape {image.shape}, {image.dtype}",
            place=f"frame {frame}",
            expected=f"{size}, uint8 luminance",
        )
    if frame and not t_s > before_s[-1]:
        raise VideoError(
            f"time {t_s:.6f} s", place=f"frame {frame}", expected=f"later than {before_s[-1]:.6f} s"
        )
