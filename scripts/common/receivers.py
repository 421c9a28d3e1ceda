"""Errors of real receivers, from their logs.

``rtk_walk`` has none: its three logs are of one receiver, and nothing says where it was.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from vgps.errors import GpsLogError
from vgps.model import FixClass, FloatArray, IntArray, Rig
from vgps.readers.gps import read_gps_log
from vgps.readers.gps_formats.fixes import NMEA_QUALITY
from vgps.readers.table import Table, read_table
from vgps.survey import ErrorSeries, read_errors

LATE_UBLOX_S = 0.09


@dataclass(frozen=True, kw_only=True)
class Series:
    """Errors of one receiver, with what it states beside its fixes.

    Attributes:
        errors: Errors, classes and stated sigmas of N epochs.
        hdop, satellites, correction_age_s: (N,) NaN where unknown.
        late_s: How much older the positions are than their time stamps.
    """

    errors: ErrorSeries
    hdop: FloatArray
    satellites: FloatArray
    correction_age_s: FloatArray
    late_s: float = 0.0

    @property
    def step_s(self) -> float:
        """Time between epochs."""
        return float(np.median(np.diff(self.errors.t_s)))

    def of_class(self, fix_class: FixClass) -> IntArray:
        """Return the epochs of a class."""
        return np.flatnonzero([one is fix_class for one in self.errors.fix_class])


def survey(data: Path) -> Series:
    """Return the errors of the standing receiver about the mean of its RTK-fixes."""
    return _of_log(data / "survey" / "stationary.nmea")


def rtk_drive(data: Path) -> Series:
    """Return the errors of a moving receiver where a better solution of the same drive is RTK-fix."""
    return _of_log(data / "rtk_drive" / "solution.pos", data / "rtk_drive" / "reference.pos")


def septentrio(data: Path) -> Series:
    """Return the errors of a moving car's receiver, 10 Hz, with changes of class."""
    table = read_table(data / "receiver_errors" / "four_seasons.csv", GpsLogError)
    qualities = table.numbers(table.require("quality"))
    classes = tuple(NMEA_QUALITY.get(int(quality), FixClass.UNKNOWN) for quality in qualities)
    hdop, satellites = (table.numbers(table.require(name)) for name in ("hdop", "satellites"))
    return Series(
        errors=_of_table(table, classes, _axes(table, "sigma_{}_m")),
        hdop=hdop,
        satellites=satellites,
        correction_age_s=np.full(len(hdop), np.nan),
    )


def ublox(data: Path) -> Series:
    """Return the errors of a moving car's u-blox: single fixes at 10 Hz without sigmas, 0.09 s late."""
    table = read_table(data / "receiver_errors" / "comma_ublox.csv", GpsLogError)
    unknown = np.full(len(table.cells), np.nan)
    return Series(
        errors=_of_table(table, (FixClass.SINGLE,) * len(unknown), np.full((len(unknown), 3), np.nan)),
        hdop=unknown,
        satellites=unknown,
        correction_age_s=unknown,
        late_s=LATE_UBLOX_S,
    )


def _of_log(log: Path, reference: Path | None = None) -> Series:
    errors = read_errors(log, reference)
    stated = read_gps_log(log, Rig(video_start_utc=datetime(2000, 1, 1, tzinfo=UTC)))  # as read_errors does
    rows = np.searchsorted(stated.t_s, errors.t_s)
    return Series(
        errors=errors,
        hdop=stated.hdop[rows],
        satellites=stated.satellites[rows],
        correction_age_s=stated.correction_age_s[rows],
    )


def _of_table(table: Table, classes: tuple[FixClass, ...], sigma_m: FloatArray) -> ErrorSeries:
    return ErrorSeries(
        t_s=table.numbers(table.require("t_s")),
        error_m=_axes(table, "error_{}_m"),
        sigma_m=sigma_m,
        fix_class=classes,
        source=table.path,
    )


def _axes(table: Table, name: str) -> FloatArray:
    columns = [table.require(name.format(axis)) for axis in ("east", "north", "up")]
    return np.stack([table.numbers(column) for column in columns], axis=1)
