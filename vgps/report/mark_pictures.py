"""Pictures of control and check points: where the image shows a mark, and where the run projects it."""

import base64
import io
from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw

from vgps.errors import VgpsError
from vgps.evaluation.check_points import Mark
from vgps.model import FloatArray, RgbImage
from vgps.readers.posed_video import open_posed_video
from vgps.solution import Solution

_HALF_PX = 24  # of the cut around a mark
_ZOOM = 5
_CROSS_PX, _RING_PX = 12, 9  # of the symbols, in the zoomed picture
_SEEN, _PROJECTED = "#ffd21f", "#e0218a"
_MOST = 40  # pictures, which bounds the size of the page


def mark_pictures(solution: Solution, marks: Sequence[Mark]) -> dict[str, str]:
    """Return a data URI by name of the mark: a cut around it in the frame of the nearest camera.

    A cross is where the image was measured, a ring where the run projects the surveyed position. Empty if the
    recording is not where the run says.
    """
    chosen = {mark.name: (mark, _nearest_view(solution, mark)) for mark in marks[:_MOST]}
    wanted = {int(mark.frame[view]) for mark, view in chosen.values()}
    if solution.recording is None or not wanted:
        return {}
    try:
        frames = dict(open_posed_video(solution.recording, solution.camera).pictures(wanted))
    except VgpsError:
        return {}
    return {
        name: _picture(frames[frame], mark.uv_px[view], mark.reprojected_px[view])
        for name, (mark, view) in chosen.items()
        if (frame := int(mark.frame[view])) in frames
    }


def _nearest_view(solution: Solution, mark: Mark) -> int:
    """Return the row of the nearest camera."""
    away = solution.world_T_camera[mark.frame, :3, 3] - mark.world_p_mark
    return int(np.argmin(np.linalg.norm(away, axis=1)))


def _picture(frame: RgbImage, seen_px: FloatArray, projected_px: FloatArray) -> str:
    u, v = np.round(seen_px).astype(int).tolist()
    corner = np.array([u - _HALF_PX, v - _HALF_PX])
    cut = Image.fromarray(frame).crop((u - _HALF_PX, v - _HALF_PX, u + _HALF_PX + 1, v + _HALF_PX + 1))
    size = _ZOOM * (2 * _HALF_PX + 1)
    cut = cut.resize((size, size), Image.Resampling.NEAREST)
    draw = ImageDraw.Draw(cut)
    x, y = (_ZOOM * (seen_px - corner + 0.5)).tolist()
    draw.line((x - _CROSS_PX, y, x + _CROSS_PX, y), fill=_SEEN, width=2)
    draw.line((x, y - _CROSS_PX, x, y + _CROSS_PX), fill=_SEEN, width=2)
    if np.isfinite(projected_px).all():
        x, y = (_ZOOM * (projected_px - corner + 0.5)).tolist()
        draw.ellipse((x - _RING_PX, y - _RING_PX, x + _RING_PX, y + _RING_PX), outline=_PROJECTED, width=2)
    stream = io.BytesIO()
    cut.save(stream, "JPEG", quality=85)
    return "data:image/jpeg;base64," + base64.b64encode(stream.getvalue()).decode("ascii")
