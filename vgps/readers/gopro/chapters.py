"""Chapters: a GoPro divides a long recording into files, without a gap, which are one video again here.

HERO6 and later write GX010042.MP4, GX020042.MP4, ... (GH for H.264), earlier ones GOPR0042.MP4, GP010042.MP4.
"""

import re
from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from vgps.errors import VideoError
from vgps.model import FloatArray, Frame, RgbImage
from vgps.readers.gopro.gpmf import Block, Telemetry, read_gpmf
from vgps.readers.video.video_file import VideoFile

_FIRST = re.compile(r"(?:(G[A-OQ-Z])01|(GOPR))(\d{4})(\.\w+)", re.IGNORECASE)
_SAME_CLOCK_S = 0.5  # stamps of a chapter that differ by more began anew


class ChapteredVideo:
    """Several files as one video; each follows the one before by its usual interval between frames."""

    def __init__(self, files: list[Path]) -> None:
        """Index all files.

        Raises:
            VideoError: A file cannot be read, or has another size than the first.
        """
        self.path = files[0]
        self._chapters = [VideoFile(file) for file in files]
        self.width, self.height = self._chapters[0].width, self._chapters[0].height
        self.quarter_turns = self._chapters[0].quarter_turns
        self.start_s = 0.0
        for chapter in self._chapters:
            if (chapter.width, chapter.height) != (self.width, self.height):
                raise VideoError(
                    f"a chapter of {chapter.width} x {chapter.height}",
                    file=chapter.path,
                    expected=f"{self.width} x {self.height} as in {self.path.name}",
                )
        lengths = [_length_s(chapter.times_s) for chapter in self._chapters]
        self.starts_s = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
        parts = zip(self._chapters, self.starts_s.tolist(), strict=True)
        self._times_s: FloatArray = np.concatenate([start + chapter.times_s for chapter, start in parts])

    @property
    def times_s(self) -> FloatArray:
        """(F,) presentation times, seconds since the first frame of the first chapter."""
        return self._times_s

    @property
    def warnings(self) -> tuple[str, ...]:
        """What files are one video, and what their last complete pass could not decode."""
        names = ", ".join(chapter.path.name for chapter in self._chapters)
        damage = (f"{chapter.path.name}: {note}" for chapter in self._chapters for note in chapter.warnings)
        return (f"{names} were read as the chapters of one recording", *damage)

    def frames(self) -> Iterator[Frame]:
        """Yield all frames in order, numbered through."""
        first = 0
        for chapter in self._chapters:
            for frame in chapter.frames():
                index = first + frame.index
                yield replace(frame, index=index, t_s=float(self.times_s[index]))
            first += len(chapter.times_s)

    def pictures(self, wanted: Collection[int]) -> Iterator[tuple[int, RgbImage]]:
        """Yield index and colours of some frames in order; those that cannot be decoded are left out."""
        first = 0
        for chapter in self._chapters:
            inside = [index - first for index in wanted if 0 <= index - first < len(chapter.times_s)]
            if inside:
                yield from ((first + index, picture) for index, picture in chapter.pictures(inside))
            first += len(chapter.times_s)

    def telemetry(self) -> Telemetry:
        """Return the metadata of all chapters on the video's clock."""
        parts = [read_gpmf(chapter.path) for chapter in self._chapters]
        sensors: dict[str, list[Block]] = {}
        lead_s = _lead_s(parts[0])
        for part, start_s in zip(parts, self.starts_s.tolist(), strict=True):
            again_s = lead_s - (_lead_s(part) - start_s)
            shift_s = again_s if abs(again_s) > _SAME_CLOCK_S else 0.0
            for key, blocks in part.sensors.items():
                sensors.setdefault(key, []).extend(
                    replace(block, start_s=block.start_s + start_s, stamp_s=block.stamp_s + shift_s)
                    for block in blocks
                )
        return Telemetry(self.path, parts[0].device, sensors, sum(part.damaged for part in parts))


def chapters_of(file: Path) -> list[Path]:
    """Return the files of the recording that begins with a file: itself, and its chapters beside it."""
    match = _FIRST.fullmatch(file.name)
    if match is None:
        return [file]
    files, prefix = [file], match[1] or match[2][0] + match[2][2]
    while True:
        number = len(files) + 1 if match[1] else len(files)
        following = file.with_name(f"{prefix}{number:02d}{match[3]}{match[4]}")
        if not following.is_file():
            return files
        files.append(following)


def _length_s(times_s: FloatArray) -> float:
    """Return the time from a chapter's first frame to that of the next."""
    return float(times_s[-1] + (np.median(np.diff(times_s)) if len(times_s) > 1 else 0.0))


def _lead_s(telemetry: Telemetry) -> float:
    """Return by how much the stamps of a file are ahead of its times; NaN without stamps."""
    ahead = [block.stamp_s - block.start_s for blocks in telemetry.sensors.values() for block in blocks]
    finite = [value for value in ahead if np.isfinite(value)]
    return float(np.median(finite)) if finite else float("nan")
