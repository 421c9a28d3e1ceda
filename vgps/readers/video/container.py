"""Video and image files opened by FFmpeg, within bounds: no other file, no network, no absurd picture."""

from pathlib import Path

import av

from vgps.errors import VideoError

# FFmpeg goes by content: a playlist named video.mp4 would open the files and addresses that it lists
_FORMATS = (
    "mov", "mp4", "matroska", "webm", "avi", "mpegts", "mpeg", "mpegvideo", "h264", "hevc", "asf",
    "flv", "mxf", "ogg", "ivf", "yuv4mpegpipe", "mjpeg", "gif", "image2", "png_pipe", "jpeg_pipe",
    "tiff_pipe", "bmp_pipe", "webp_pipe", "pgm_pipe", "ppm_pipe", "pnm_pipe", "pgmyuv_pipe", "dpx_pipe",
    "exr_pipe", "jpegxl_pipe",
)  # fmt: skip
_VIDEO_PIXELS = 36_000_000  # 8K; a decoder holds up to twenty pictures
_IMAGE_PIXELS = 64_000_000


def open_container(path: Path) -> av.container.InputContainer:
    """Open a video or an image for reading.

    Raises:
        av.FFmpegError, OSError: FFmpeg cannot read the file, or it is of no kind that holds pictures itself.
    """
    options = {"protocol_whitelist": "file", "format_whitelist": ",".join(_FORMATS)}
    # "file:" since a name may look like another protocol; makers write their names in any encoding
    return av.open(f"file:{path}", options=options, metadata_errors="replace")


def check_size(width: int, height: int, path: Path, *, image: bool = False) -> None:
    """Check a declared size before pictures are decoded.

    Raises:
        VideoError: The decoder would need more than a gigabyte.
    """
    most = _IMAGE_PIXELS if image else _VIDEO_PIXELS
    if width * height > most:
        raise VideoError(
            f"a picture of {width} x {height}",
            file=path,
            expected=f"at most {most / 1e6:.0f} megapixels",
            remedy="reduce the size, and calibrate the camera at it",
        )
