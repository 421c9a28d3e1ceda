"""A folder of images with their times, read as a video."""

import logging
import re
from collections.abc import Collection, Generator, Iterator
from pathlib import Path

import av
import numpy as np
from PIL import Image

from vgps.errors import VideoError
from vgps.model import FloatArray, Frame, GrayImage, RgbImage
from vgps.readers.video.container import check_size, open_container
from vgps.readers.video.exif import Taken, picture_times, read_taken
from vgps.readers.video.frame_times import FRAME_TIMES, FrameTimes, read_frame_times
from vgps.readers.video.picture import colours, luma, quarter_turns, upright_size
from vgps.runtime.threads import run_ahead

_ORIENTATION, _MIRRORED = 0x0112, {2, 4, 5, 7}
log = logging.getLogger(__name__)
_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm"})


class ImageFolder:
    """Images in order of their names (numbers by value) with their times.

    Times are those of ``frame_times.csv`` in the folder or beside it: a column ``file`` names the images, a
    column ``frame`` numbers the sorted ones from 0. Without the table, they are the pictures' EXIF, and the
    order is that of time. An image that cannot be decoded becomes a black frame, with an entry in
    ``warnings`` and in the log.
    """

    def __init__(self, path: str | Path) -> None:
        """List the images and decode the first.

        Raises:
            VideoError: There are no images or no times, or their numbers differ.
        """
        self.path = Path(path)
        table = _table(self.path)
        self._taken = {} if table else {file: read_taken(file) for file in list_images(self.path)}
        times = read_frame_times(table) if table else picture_times(self.path, list(self._taken.values()))
        self.files = _files(self.path, times)
        self._times_s: FloatArray = times.t_s - times.t_s[0]
        self.start_s = float(times.t_s[0])
        self._warnings: tuple[str, ...] = ()
        first = _picture(self.files[0])
        if first is None:
            raise VideoError("the first image cannot be decoded", file=self.files[0])
        _check_orientation(self.files[0])
        self.width, self.height = upright_size(first)
        self.quarter_turns = quarter_turns(first)

    @property
    def times_s(self) -> FloatArray:
        """(F,) times, seconds since the first frame, strictly increasing."""
        return self._times_s

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the last pass over the frames could not decode, as sentences."""
        return self._warnings

    def taken(self, index: int) -> Taken:
        """Return when and where an image was taken; each is read once."""
        file = self.files[index]
        if file not in self._taken:
            self._taken[file] = read_taken(file)
        return self._taken[file]

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order, decoded ahead in a separate thread.

        Raises:
            VideoError: An image has another size than the first.
        """
        return run_ahead(self._frames)

    def pictures(self, wanted: Collection[int]) -> Iterator[tuple[int, RgbImage]]:
        """Yield index and colours of some images in order; those that cannot be decoded are left out."""
        for index in sorted(wanted):
            picture = _picture(self.files[index])
            if picture is not None:
                yield index, colours(picture)

    def _frames(self) -> Generator[Frame]:
        lost = []
        for index, (file, t_s) in enumerate(zip(self.files, self._times_s, strict=True)):
            gray = self._gray(file)
            if gray is None:
                lost.append(file.name)
                gray = np.zeros((self.height, self.width), np.uint8)
            yield Frame(index, float(t_s), gray)
        if lost:
            self._warnings = (f"{len(lost)} of {len(self.files)} images cannot be decoded, first {lost[0]}",)
            log.warning("%s: %s", self.path, self._warnings[0])

    def _gray(self, file: Path) -> GrayImage | None:
        picture = _picture(file)
        if picture is None:
            return None
        if upright_size(picture) != (self.width, self.height):
            raise VideoError(
                f"an image of {picture.width} x {picture.height}",
                file=file,
                expected=f"{self.width} x {self.height} as the first image",
            )
        return luma(picture)


def _check_orientation(file: Path) -> None:
    """Refuse a picture that its EXIF mirrors: nothing says which of the two the scene is."""
    try:
        with Image.open(file) as picture:
            orientation = picture.getexif().get(_ORIENTATION)
    except (OSError, ValueError, SyntaxError):
        return
    if orientation in _MIRRORED:
        raise VideoError(
            f"an orientation in EXIF that mirrors the picture ({orientation})",
            file=file,
            expected="none, or one of quarter turns (1, 3, 6, 8)",
            remedy="save the pictures again as they should be seen",
        )


def list_images(folder: Path) -> list[Path]:
    """Return the images of a folder in order of their names, numbers in them by value."""
    images = [file for file in folder.iterdir() if file.suffix.lower() in _SUFFIXES and file.is_file()]
    return sorted(
        images, key=lambda file: [(int(part) if part.isdecimal() else -1, part) for part in _parts(file)]
    )


def _parts(file: Path) -> list[str]:
    return re.findall(r"\d+|\D+", file.stem)


def _table(folder: Path) -> Path | None:
    """Return the table of times in the folder or beside it."""
    if not folder.is_dir():
        raise VideoError("no such folder of images", file=folder)
    tables = (folder / FRAME_TIMES, folder.parent / FRAME_TIMES)
    return next((table for table in tables if table.is_file()), None)


def _files(folder: Path, times: FrameTimes) -> list[Path]:
    if times.files is not None:
        files = [folder / name for name in times.files]
        missing = [file for file in files if not file.is_file()]
        if missing:
            raise VideoError(f"no image {missing[0].name}", file=times.path, expected=f"images in {folder}")
        return files
    files = list_images(folder)
    if len(files) != len(times.t_s):
        raise VideoError(
            f"{len(times.t_s)} times",
            file=times.path,
            expected=f"{len(files)}, a row for every image in {folder}",
        )
    return files


def _picture(file: Path) -> av.VideoFrame | None:
    try:
        with open_container(file) as container:
            for stream in container.streams.video:
                check_size(stream.width, stream.height, file, image=True)
            return next(container.decode(video=0), None)
    except (av.error.FFmpegError, OSError, IndexError):
        return None
