"""Errors in a user's input, one class per kind; the CLI prints each as one line and exits with code 2."""

from pathlib import Path

# characters of a part of a message: a damaged file may have megabytes on a line
_LONGEST, _LONGEST_ADVICE = 240, 700


class VgpsError(Exception):
    """Bad input in one line: file, place in it, what was found, what was expected, what to do.

    Args:
        found: What was found, as a short clause.
        file: The file concerned, if any.
        place: Position in the file: ``line 12``, ``frame 40``, ``key camera.fx``.
        expected: What would have been right.
        remedy: What the user can do about it.
    """

    def __init__(
        self,
        found: str,
        *,
        file: Path | str | None = None,
        place: str | None = None,
        expected: str | None = None,
        remedy: str | None = None,
    ) -> None:
        self.found, self.file, self.place = found, file, place
        self.expected, self.remedy = expected, remedy
        where = [_printable(str(file), None)] if file is not None else []
        where += [_printable(place)] if place is not None else []
        parts = [_printable(found)] if found else []
        parts += [
            _printable(part, _LONGEST_ADVICE)
            for part in (expected and f"expected {expected}", remedy)
            if part
        ]
        what = "; ".join(parts)
        super().__init__(f"{', '.join(where)}: {what}" if where else what)


def _printable(text: str, longest: int | None = _LONGEST) -> str:
    """Return a text on one line, cut where it is too long, with escapes for what a terminal would obey."""
    line = " ".join(text[: longest and 2 * longest].split())
    if longest is not None and len(line) > longest:
        line = f"{line[:longest]}..."
    return "".join(char if char.isprintable() else ascii(char)[1:-1] for char in line)


class RecordingError(VgpsError):
    """A recording folder that is missing, empty, or lacks one of its files."""


class VideoError(VgpsError):
    """A video without frames, of another size than its camera, or undecodable."""


class CalibrationError(VgpsError):
    """A camera.yaml or rig.yaml with missing, unknown or impossible fields."""


class GpsLogError(VgpsError):
    """A GPS log that is unreadable, of another day, or has too few usable fixes."""


class GyroLogError(VgpsError):
    """An unreadable gyro log."""


class ImuLogError(VgpsError):
    """An IMU log that is unreadable, or in other units."""


class ConfigError(VgpsError):
    """A configuration or survey file with unknown keys or impossible values."""


class TrajectoryError(VgpsError):
    """A trajectory (truth or result) that is unreadable or has no time in common with the other."""


class RunFolderError(VgpsError):
    """A run folder that is incomplete, or an output that cannot be written."""


class OutputError(VgpsError):
    """An address that poses cannot be sent to."""


class GeometryError(VgpsError):
    """Input whose geometry does not determine the answer: no motion, too few features, too few fixes."""


class LandmarkDatabaseError(VgpsError):
    """A landmark database that is missing, empty, damaged, foreign, too new, or cannot be written."""


class CoordinateSystemError(VgpsError):
    """A coordinate system or geoid that is unknown, lacks its grid, or does not cover the place."""


class ClusterError(VgpsError):
    """A scheduler that cannot be reached, has no workers, or has some of other versions."""


class ViewerError(VgpsError):
    """A viewer without a display, or that cannot draw."""
