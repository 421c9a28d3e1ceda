"""Pictures that no lens model here describes: of the whole sphere, or with pixels that are not square."""

import logging
from pathlib import Path

import av

from vgps.errors import VideoError
from vgps.readers.gopro.lens import gopro_settings
from vgps.readers.video.container import open_container
from vgps.readers.video.mp4_boxes import read_boxes

log = logging.getLogger(__name__)

_OTHER_TRACKS = (
    "%s: has %d tracks of pictures, of which one is used; those of other lenses can be taken out "
    "(ffmpeg -i FILE -map 0:v:1 -c copy OTHER.mp4) and listed in rig.yaml"
)
CUT_A_VIEW = "ffmpeg -i FILE -vf v360=e:flat:h_fov=90:v_fov=90 OUT.mp4"
_SQUARE = 0.01  # by which the sides of a pixel may differ, as after rounding a size


def check_flat(file: Path) -> None:
    """Check that a video is not of the whole sphere, by the boxes of Spherical Video or a GoPro's settings.

    An equirectangular one, which is seen through several views, is not checked.

    Raises:
        VideoError: It is.
    """
    entries = read_boxes(file, "moov", "trak", "mdia", "minf", "stbl", "stsd")
    marks = read_boxes(file, "moov", "trak", "uuid")
    projection = gopro_settings(file).get("PRJT")
    if (
        any(b"sv3d" in entry for entry in entries)
        or any(b"GSpherical" in mark for mark in marks)
        or (projection is not None and projection.data.startswith(b"EAC"))
    ):
        raise VideoError(
            "a picture of the whole sphere",
            file=file,
            expected="that of one lens",
            remedy="give the videos of the lenses, with a rig.yaml that lists the second, or export it as "
            f"equirectangular, without a camera.yaml, or cut an ordinary view out of it ({CUT_A_VIEW})",
        )


def log_other_tracks(file: Path) -> None:
    """Log that a video has more tracks of pictures of the same size, as of a camera with two lenses."""
    try:
        with open_container(file) as container:
            sizes = [(stream.width, stream.height) for stream in container.streams.video]
    except (av.FFmpegError, OSError):
        return
    if sizes and (count := sizes.count(sizes[0])) > 1:
        log.warning(_OTHER_TRACKS, file, count)


def check_square_pixels(file: Path) -> None:
    """Check that a video without a calibration has square pixels.

    Raises:
        VideoError: It has not.
    """
    try:
        with open_container(file) as container:
            ratio = container.streams.video[0].sample_aspect_ratio
    except (av.FFmpegError, OSError, IndexError):
        return
    if ratio and abs(float(ratio) - 1.0) > _SQUARE:
        raise VideoError(
            f"pixels of {ratio.numerator} : {ratio.denominator}",
            file=file,
            expected="square ones, or a calibration",
            remedy="give a camera.yaml, or encode it again "
            "(ffmpeg -i FILE -vf scale=iw*sar:ih,setsar=1 OUT.mp4)",
        )
