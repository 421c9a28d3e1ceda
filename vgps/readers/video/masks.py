"""Masks beside a video: what of its pictures is left out, as COLMAP reads them."""

from pathlib import Path

import numpy as np
from PIL import Image

from vgps.errors import RecordingError
from vgps.model import BoolArray, Video
from vgps.readers.video.images import ImageFolder, list_images

MASKS = "masks"  # folder of masks beside a video
_EXPECTED = "a PNG with black where a picture shows what is not of the scene"


class MaskFolder:
    """Masks of a video's frames; black (0) is left out.

    A mask has the name of its image with ``.png`` behind it, as in COLMAP; for a video, the number of its
    frame from 0 (``000012.png``). A mask with the name of the video (``video.mp4.png``) counts for every
    frame without one of its own, for what never moves in the picture: a bonnet, a reflection, burnt-in text.
    """

    def __init__(self, folder: Path, video: Video) -> None:
        """List the masks.

        Raises:
            RecordingError: A mask belongs to no frame.
        """
        self._size = (video.width, video.height)
        self._of_frame: dict[int, Path] = {}
        self._of_all: Path | None = None
        numbers = _frame_numbers(video)
        for file in list_images(folder):
            name = file.name[: -len(file.suffix)]
            if name == video.path.name:
                self._of_all = file
            elif name in numbers:
                self._of_frame[numbers[name]] = file
            elif name.isdecimal():
                self._of_frame[int(name)] = file
            else:
                raise RecordingError("a mask of no frame", file=file, expected=_names(video))
        beyond = [file for number, file in self._of_frame.items() if number >= len(video.times_s)]
        if beyond:
            raise RecordingError(
                f"a mask of no frame: the video has {len(video.times_s)}",
                file=beyond[0],
                expected=_names(video),
            )

    @property
    def files(self) -> tuple[Path, ...]:
        """The masks."""
        return (*self._of_frame.values(), *([] if self._of_all is None else [self._of_all]))

    def of_frame(self, index: int) -> BoolArray | None:
        """Return where a frame shows the scene (H, W); None if it has no mask.

        Raises:
            RecordingError: The mask cannot be read, or has another size than the video.
        """
        file = self._of_frame.get(index, self._of_all)
        return None if file is None else self._read(file)

    def _read(self, file: Path) -> BoolArray:
        try:
            with Image.open(file) as picture:
                if picture.size != self._size:
                    raise RecordingError(
                        f"a mask of {picture.width} x {picture.height}",
                        file=file,
                        expected="{} x {} as the video".format(*self._size),
                    )
                return np.asarray(np.asarray(picture.convert("L")) > 0)
        except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
            raise RecordingError(
                f"a mask that cannot be read ({error})", file=file, expected=_EXPECTED
            ) from error


def find_masks(folder: Path, video: Video) -> MaskFolder | None:
    """Return the masks in a recording's folder, if there are any."""
    return MaskFolder(folder / MASKS, video) if (folder / MASKS).is_dir() else None


def _frame_numbers(video: Video) -> dict[str, int]:
    """Return the number of the frame of each image's name, with and without its suffix."""
    if not isinstance(video, ImageFolder):
        return {}
    names = [(file.name, file.stem) for file in video.files]
    return {name: index for index, both in enumerate(names) for name in both}


def _names(video: Video) -> str:
    return "the name of an image and .png" if isinstance(video, ImageFolder) else "000000.png for frame 0"
