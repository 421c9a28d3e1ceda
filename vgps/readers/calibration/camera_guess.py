"""What a recording without a calibration says of its camera, or else what most cameras are.

Focal lengths in 35 mm terms refer to the diagonal of 36 x 24 mm (CIPA DCG-001). A video shows the whole width
of a sensor of 4:3 at best, so its pixels are those of a picture of 4:3 and the same width.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from vgps.camera import centred_camera
from vgps.model import CameraGuess, Video
from vgps.readers.gopro.chapters import ChapteredVideo
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.gopro.lens import gopro_guess
from vgps.readers.video.images import ImageFolder
from vgps.readers.video.tags import video_tags
from vgps.readers.video.video_file import VideoFile
from vgps.readers.video_gps.dji_metadata import dji_names
from vgps.readers.video_gps.dji_srt import files_beside, subtitles_in

_DIAGONAL_35_MM = float(np.hypot(36.0, 24.0))
_DJI_MM = 24.0  # in 35 mm terms, of the wide camera of nearly all DJI drones since 2017
_PHONE_MM = 27.0  # main camera of an iPhone 13 in a video, by its own tag; other phones have 23 to 28
_EXIF_IFD, _FOCAL_35 = 0x8769, 0xA405
_SUBTITLE_BYTES = 4000
_FOCAL_LEN = re.compile(r"focal_len\s*:\s*(\d+(?:\.\d+)?)")
_ZOOM = re.compile(r"dzoom_ratio\s*:\s*(\d+(?:\.\d+)?)")
_DRONES_TEXT = re.compile(r"\biso\s*:|GPS|latitude")  # in subtitles; a caption may have "comparison"
_WIDE_DJI = re.compile(r"Action|Avata|(?<![a-z])Neo|dvtm_(?:ac|oq)", re.IGNORECASE)  # much wider lenses
_NOTHING_KNOWN = "nothing is known of the camera"
_FOCAL_TAG = "camera.focal_length.35mm_equivalent"


def guess_cameras(video: Video, telemetry: Telemetry) -> tuple[CameraGuess, ...]:
    """Return what the camera of a recording without a calibration may be, the likeliest first.

    What the file states may be wrong: stabilisation and zoom crop the picture, programs linearise it. So any
    lens follows what is stated, for the video to decide.

    Args:
        video: The recording's video or folder of images.
        telemetry: A GoPro's metadata, empty for others.
    """
    size = (video.width, video.height)
    found = gopro_guess(telemetry, size)
    if found is None and isinstance(video, ImageFolder):
        found = _of_pictures(video.files[0], size)
    if found is None and isinstance(video, VideoFile | ChapteredVideo):
        text = _subtitles(video.path)
        found = _by_focal_len(text, size) or _by_maker(video.path, text, size)
    if found is None:
        return _unknown(size, _NOTHING_KNOWN)
    return (found, *_unknown(size, f"{found.source}, which the video contradicts"))


def _of_pictures(file: Path, size: tuple[int, int]) -> CameraGuess | None:
    try:
        with Image.open(file) as picture:
            equivalent_mm = float(picture.getexif().get_ifd(_EXIF_IFD).get(_FOCAL_35, 0))
    except (OSError, ValueError, TypeError, SyntaxError, ZeroDivisionError):
        return None
    if not 5.0 <= equivalent_mm <= 1000.0:
        return None
    focal_px = equivalent_mm / _DIAGONAL_35_MM * float(np.hypot(*size))
    return _rectilinear(size, focal_px, 0.05, f"a lens of {equivalent_mm:g} mm in 35 mm terms by its EXIF")


def _by_maker(file: Path, text: str, size: tuple[int, int]) -> CameraGuess | None:
    """Return a guess from the tags of a phone's or a drone's video, or as its subtitles are a drone's."""
    tags = video_tags(file)
    make, model = str(tags.get("make", "")), str(tags.get("model", ""))
    name = model if model.startswith(make) else f"{make} {model}".strip()
    stated = _leading_number(tags.get(_FOCAL_TAG))
    if stated is not None:
        return _wide_sensor(size, stated, 0.08, f"{stated:g} mm in 35 mm terms by its tags", name)
    everything = " ".join((*(f"{key} {value}" for key, value in tags.items()), *dji_names(file)))
    if "DJI" in everything or "dvtm" in everything:
        return None if _WIDE_DJI.search(everything) else _of_a_drone(size, name)
    if make == "Apple" or "android" in everything:
        return _wide_sensor(size, _PHONE_MM, 0.15, f"{_PHONE_MM:g} mm in 35 mm terms, as most phones", name)
    return _of_a_drone(size, "") if _DRONES_TEXT.search(text) else None


def _subtitles(file: Path) -> str:
    """Return the first subtitles beside a video or in it."""
    text = next((_head(one) for one in files_beside(file)), "")
    return text or " ".join(words for _, words in subtitles_in(file, most=1))


def _by_focal_len(text: str, size: tuple[int, int]) -> CameraGuess | None:
    """Return a guess from a drone's subtitles by ``focal_len`` in mm or tenths and ``dzoom_ratio``."""
    length, zoom = _FOCAL_LEN.search(text), _ZOOM.search(text)
    if length is None:
        return None
    millimetres = float(length[1]) / (10.0 if float(length[1]) >= 100.0 else 1.0)
    factor = float(zoom[1]) if zoom else 1.0
    factor = factor / 1e4 if factor >= 1000.0 else max(factor, 1.0)
    return _wide_sensor(size, millimetres * factor, 0.10, f"{millimetres:g} mm by its subtitles", "")


def _of_a_drone(size: tuple[int, int], name: str) -> CameraGuess | None:
    return _wide_sensor(size, _DJI_MM, 0.15, f"{_DJI_MM:g} mm in 35 mm terms, as most DJI drones", name)


def _unknown(size: tuple[int, int], source: str) -> tuple[CameraGuess, ...]:
    """Return the lenses of most cameras: little distortion, or a fisheye."""
    longer = max(size)
    words = source + ": it was taken as {} of {:.0f} degrees' width, very roughly"
    plain = _rectilinear(size, 0.85 * longer, 0.5, words.format("a lens with little distortion", 61.0))
    wide = _rectilinear(size, 0.5 * longer, 0.4, words.format("a fisheye", 115.0))
    return (
        replace(plain, distortion_sigma=(0.2, 0.1)),
        replace(wide, camera=replace(wide.camera, model="fisheye")),
    )


def _wide_sensor(
    size: tuple[int, int], equivalent_mm: float, sigma: float, source: str, name: str
) -> CameraGuess | None:
    """Return a guess of a video that has the whole width of a sensor of 4:3."""
    if not 5.0 <= equivalent_mm <= 1000.0:
        return None
    focal_px = equivalent_mm / _DIAGONAL_35_MM * 1.25 * max(size)
    return _rectilinear(size, focal_px, sigma, f"{name or 'a camera'} with a lens of {source}")


def _rectilinear(size: tuple[int, int], focal_px: float, sigma: float, source: str) -> CameraGuess:
    return CameraGuess(
        camera=centred_camera("opencv", size, focal_px),
        focal_sigma=sigma,
        centre_sigma_px=0.01 * max(size),
        distortion_sigma=(0.1, 0.1),
        source=source,
    )


def _head(file: Path) -> str:
    with file.open("rb") as stream:
        return stream.read(_SUBTITLE_BYTES).decode("utf-8", errors="replace")


def _leading_number(value: str | float | None) -> float | None:
    found = re.match(r"\s*([\d.]+)", str(value))
    try:
        return float(found[1]) if found else None
    except ValueError:
        return None
