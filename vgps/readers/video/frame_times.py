"""``frame_times.csv``: externally measured presentation times of a video or a folder of images."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vgps.errors import VideoError
from vgps.model import FloatArray
from vgps.readers.table import first_unordered, read_table

FRAME_TIMES = "frame_times.csv"


@dataclass(frozen=True)
class FrameTimes:
    """Times of frames: ``t_s`` (F,) increasing, on the file's clock; ``files`` (F,) image names, if given."""

    t_s: FloatArray
    files: tuple[str, ...] | None
    path: Path


def read_frame_times(path: Path) -> FrameTimes:
    """Read columns ``frame,t_s`` (frames 0, 1, 2, ...) or ``file,t_s``.

    Raises:
        VideoError: A column or a frame is missing, or a time is not finite or does not increase.
    """
    table = read_table(path, VideoError)
    t_s = table.numbers(table.require("t_s"))
    if len(t_s) == 0:
        raise VideoError("no rows", file=path, expected="a row for every frame")
    files = tuple(table.text("file")) if "file" in table.columns else None
    if files is None:
        frame = table.numbers(table.require("frame", "file"))
        wrong = np.flatnonzero(frame != np.arange(len(frame)))
        if len(wrong):
            row = wrong[0]
            raise VideoError(
                f"frame {frame[row]:g}", file=path, place=f"line {table.line[row]}", expected=f"frame {row}"
            )
    row = first_unordered(t_s)
    if row is not None:
        raise VideoError(
            f"t_s {t_s[row]:g}",
            file=path,
            place=f"line {table.line[row]}",
            expected="a time later than the last",
        )
    return FrameTimes(t_s, files, path)
