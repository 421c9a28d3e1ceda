"""Errors of receivers from their logs: about the point where they stood, or against a better log."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from vgps.config import SurveyConfig
from vgps.errors import GpsLogError
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import FixClass, FloatArray, GeodeticPoint, GpsLog, IntArray, Rig
from vgps.readers.gps import read_gps_log

# any start, the same for a log and its reference
CLOCK = Rig(video_start_utc=datetime(2000, 1, 1, tzinfo=UTC))
_MAX_SPREAD_M = SurveyConfig().max_spread_m
_SAME_TIME_S = 0.01


@dataclass(frozen=True, kw_only=True)
class ErrorSeries:
    """Errors of a receiver's fixes, in order of time.

    Attributes:
        t_s: (N,).
        error_m: (N, 3) fix minus truth, east, north, up.
        sigma_m: (N, 3) the receiver's own sigmas; NaN where unknown.
        fix_class: (N,).
        source: The log.
    """

    t_s: FloatArray
    error_m: FloatArray
    sigma_m: FloatArray
    fix_class: tuple[FixClass, ...]
    source: Path

    def of_class(self, fix_class: FixClass) -> "ErrorSeries":
        """Return the epochs of one class."""
        rows = np.array([one is fix_class for one in self.fix_class], bool)
        classes = (fix_class,) * int(rows.sum())
        return ErrorSeries(
            t_s=self.t_s[rows],
            error_m=self.error_m[rows],
            sigma_m=self.sigma_m[rows],
            fix_class=classes,
            source=self.source,
        )


def read_errors(log: Path, reference: Path | None = None) -> ErrorSeries:
    """Read the errors of a receiver's log.

    Args:
        log: Of a standing receiver, or of a moving one with a reference.
        reference: A better log of the same antenna, whose RTK-fix epochs are the truth. Without one, the
            truth is the mean of the log's own RTK-fix epochs.

    Raises:
        GpsLogError: A log cannot be read or has no RTK-fix, the receiver moved without a reference, or the
            logs have no time in common.
    """
    own = read_gps_log(log, CLOCK)
    if reference is None:
        return errors_about(mean_of_fixes([own]), own)
    return errors_against(read_gps_log(reference, CLOCK), own)


def errors_about(truth: GeodeticPoint, log: GpsLog) -> ErrorSeries:
    """Return the errors of a standing receiver's log."""
    return _series(log, np.arange(len(log)), _enu(truth, log))


def errors_against(reference: GpsLog, log: GpsLog, max_spread_m: float = _MAX_SPREAD_M) -> ErrorSeries:
    """Return the errors of a log at the RTK-fix epochs of a better one of the same antenna.

    Args:
        reference: The better log, on the same clock.
        log: The log.
        max_spread_m: Largest median distance between RTK-fixes of both.

    Raises:
        GpsLogError: The reference has no RTK-fix or none at a time of the log, it is the log itself, or it is
            of another antenna.
    """
    fixed = _rows_of_fixes(reference)
    if not len(fixed):
        raise GpsLogError(
            "no RTK-fix epoch in the reference",
            file=reference.source,
            remedy="give a better log of the drive",
        )
    rows, theirs = _common(log.t_s, reference.t_s[fixed])
    if not len(rows):
        raise GpsLogError(
            "no fix at the time of an RTK-fix of the reference",
            file=log.source,
            expected=f"fixes at the times of {reference.source}",
            remedy="give the reference solution of the same drive",
        )
    theirs = fixed[theirs]
    origin = GeodeticPoint(*_place(reference)[theirs[0]].tolist())
    found = _series(log, rows, _enu(origin, log)[rows] - _enu(origin, reference)[theirs])
    _check_antenna(found, reference.source, max_spread_m)
    return found


def mean_of_fixes(logs: Sequence[GpsLog], max_spread_m: float = _MAX_SPREAD_M) -> GeodeticPoint:
    """Return the mean of the RTK-fix epochs of a standing receiver.

    Raises:
        GpsLogError: There is none, or the receiver moved.
    """
    place = np.concatenate([_place(log)[_rows_of_fixes(log)] for log in logs])
    if not len(place):
        raise GpsLogError(
            "no RTK-fix epoch, so that the antenna's position is unknown",
            file=logs[0].source,
            remedy="give its position with --truth LATITUDE,LONGITUDE,HEIGHT",
        )
    # the mean is in metres, since degrees have none at the date line
    origin = GeodeticPoint(*place[0].tolist())
    local = to_enu(origin, *place.T)
    mean = local.mean(axis=0)
    spread = float(np.median(np.linalg.norm(local - mean, axis=1)))
    if spread > max_spread_m:
        raise GpsLogError(
            f"half of the RTK-fix epochs are more than {spread:.1f} m from their mean: the receiver moved",
            file=logs[0].source,
            expected=f"at most {max_spread_m:g} m, as of a standing receiver",
            remedy="cut the log to the time when it stood still, or give --truth or --reference",
        )
    return GeodeticPoint(*to_geodetic(origin, mean).tolist())


def _check_antenna(errors: ErrorSeries, reference: Path, max_spread_m: float) -> None:
    """Raise GpsLogError if the reference is the log itself, or of another antenna."""
    distance = np.linalg.norm(errors.error_m, axis=1)
    if not distance.any():
        raise GpsLogError(
            f"the same as the reference {reference} at {len(distance)} common epochs",
            file=errors.source,
            expected="a log of another receiver or another solution",
        )
    both = distance[[name is FixClass.RTK_FIX for name in errors.fix_class]]
    if len(both) and np.median(both) > max_spread_m:
        raise GpsLogError(
            f"half of its RTK-fixes are more than {np.median(both):.1f} m from those of {reference}",
            file=errors.source,
            expected=f"at most {max_spread_m:g} m, as of the same antenna",
            remedy="give a reference of the same antenna and the same datum",
        )


def _common(own_s: FloatArray, better_s: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the rows of two ordered sequences at common times."""
    after = np.searchsorted(better_s, own_s).clip(0, len(better_s) - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(own_s - better_s[before] < better_s[after] - own_s, before, after)
    rows = np.flatnonzero(np.abs(own_s - better_s[nearest]) < _SAME_TIME_S)
    return rows, nearest[rows]


def _rows_of_fixes(log: GpsLog) -> IntArray:
    return np.flatnonzero([name is FixClass.RTK_FIX for name in log.fix_class])


def _place(log: GpsLog) -> FloatArray:
    return np.stack([log.latitude_deg, log.longitude_deg, log.height_m], axis=1)


def _enu(origin: GeodeticPoint, log: GpsLog) -> FloatArray:
    return to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m)


def _series(log: GpsLog, rows: IntArray, error_m: FloatArray) -> ErrorSeries:
    return ErrorSeries(
        t_s=log.t_s[rows],
        error_m=error_m,
        sigma_m=log.sigma_m[rows],
        fix_class=tuple(log.fix_class[row] for row in rows),
        source=log.source,
    )
