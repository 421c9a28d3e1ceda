"""A decoded picture: its luminance, its colours, and which way is up."""

from pathlib import Path
from typing import Any, cast

import av
import numpy as np
import numpy.typing as npt
from av.sidedata.sidedata import Type as SideDataType

from vgps.errors import VideoError
from vgps.model import GrayImage, RgbImage

_QUARTER_TURN = 0.01  # by which a rotation may miss a quarter turn


def luma(picture: av.VideoFrame) -> GrayImage:
    """Return the luminance of a decoded image, upright, (H, W) uint8.

    This is the stored Y plane (the upper 8 bits); colour without a Y plane is converted. The rotation flag is
    applied.
    """
    gray = _y_plane(picture) if _has_y_plane(picture.format) else _converted(picture)
    turns = quarter_turns(picture)
    return np.ascontiguousarray(np.rot90(gray, turns)) if turns else gray


def colours(picture: av.VideoFrame) -> RgbImage:
    """Return the colours of a decoded image, upright, (H, W, 3) uint8 red, green, blue."""
    rgb = np.asarray(picture.to_ndarray(format="rgb24"))
    return np.ascontiguousarray(np.rot90(rgb, quarter_turns(picture)))


def quarter_turns(picture: av.VideoFrame) -> int:
    """Return the rotation flag in counterclockwise quarter turns, 0..3."""
    return round(picture.rotation / 90) % 4


def check_upright(picture: av.VideoFrame, file: Path) -> None:
    """Check that the display matrix turns a decoded image by quarter turns only.

    Raises:
        VideoError: It mirrors the image, where nothing says whether the scene or its mirror image would be
            seen, or turns it by another angle.
    """
    try:
        side_data: Any = picture.side_data
        matrices = [data for data in side_data if data.type == SideDataType.DISPLAYMATRIX]
    except ValueError:  # side data of a kind that PyAV does not know
        return
    if not matrices:
        return
    rows = np.frombuffer(bytes(matrices[0]), np.int32).reshape(3, 3)[:2, :2] / 65536.0
    if np.linalg.det(rows) < 0.0:
        found = "a display matrix that mirrors the picture"
    elif np.abs(picture.rotation / 90.0 - round(picture.rotation / 90.0)) > _QUARTER_TURN:
        found = f"a display matrix that turns the picture by {picture.rotation:.0f} degrees"
    else:
        return
    raise VideoError(
        found,
        file=file,
        expected="none, or one of quarter turns",
        remedy="encode it again as it should be seen (ffmpeg -i FILE OUT.mp4 applies the matrix)",
    )


def upright_size(picture: av.VideoFrame) -> tuple[int, int]:
    """Return width and height after the rotation flag, pixels."""
    size = (picture.width, picture.height)
    return size[::-1] if quarter_turns(picture) % 2 else size


def _has_y_plane(form: av.VideoFormat) -> bool:
    first, *others = form.components
    alone = first.is_luma and first.plane == 0 and all(other.plane != 0 for other in others)
    # p010 and similar formats store their bits at the upper end; only plain formats are read directly
    depth = first.bits == 8 or (8 < first.bits <= 16 and form.name.startswith(("yuv", "gray")))
    return bool(alone and depth and not form.has_palette)


def _y_plane(picture: av.VideoFrame) -> GrayImage:
    bits, plane = picture.format.components[0].bits, picture.planes[0]
    dtype = np.dtype(np.uint8 if bits == 8 else ">u2" if picture.format.is_big_endian else "<u2")
    # rows are padded to line_size bytes
    stored: npt.NDArray[np.uint8 | np.uint16] = np.frombuffer(cast(memoryview, plane), dtype)
    rows = stored.reshape(-1, plane.line_size // dtype.itemsize)
    y = rows[: picture.height, : picture.width]
    return np.array(y if bits == 8 else y >> (bits - 8), dtype=np.uint8, order="C")


def _converted(picture: av.VideoFrame) -> GrayImage:
    return _y_plane(picture.reformat(format="gray"))
