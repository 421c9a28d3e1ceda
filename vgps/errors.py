"""Errors in a user's input, one class per kind; the CLI prints each as one line and exits with code 2."""

from pathlib import Path


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
        where = ", ".join(str(part) for part in (file, place) if part is not None)
        parts = [
            found,
            f"expected {expected}" if expected else None,
            remedy,
        ]
        what = "; ".join(part for part in parts if part)
        line = f"{where}: {what}" if where else what
        super().__init__(" ".join(line.split()))


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


class ConfigError(VgpsError):
    """A configuration or survey file with unknown keys or impossible values."""


class TrajectoryError(VgpsError):
    """A trajectory (truth or result) that is unreadable or has no time in common with the other."""


class RunFolderError(VgpsError):
    """A run folder that is incomplete, or an output that cannot be written."""


class GeometryError(VgpsError):
    """Input whose geometry does not determine the answer: no motion, too few features, too few fixes."""


class LandmarkDatabaseError(VgpsError):
    """A landmark database that is missing, empty, damaged, foreign, too new, or cannot be written."""


class CoordinateSystemError(VgpsError):
    """A coordinate system or geoid that is unknown, lacks its grid, or does not cover the place."""


class ViewerError(VgpsError):
    """A viewer without a display, or that cannot draw."""
