"""A GPS log: fixes, their classes and positions."""

from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vgps.model.arrays import BoolArray, FloatArray, IntArray


class FixClass(StrEnum):
    """How a GPS fix was obtained, best first; the class determines the size of its region."""

    RTK_FIX = "rtk_fix"
    RTK_FLOAT = "rtk_float"
    PPP = "ppp"
    DGPS = "dgps"
    SBAS = "sbas"
    SINGLE = "single"
    UNKNOWN = "unknown"


class GeodeticPoint(NamedTuple):
    """A WGS84 position: degrees, degrees, ellipsoidal height in metres."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


@dataclass(frozen=True, kw_only=True)
class GpsLog:
    """GPS fixes in chronological order, one row each; unknown numbers are NaN.

    Attributes:
        t_s: (N,) seconds since the video's first frame.
        latitude_deg, longitude_deg, height_m: (N,) WGS84, ellipsoidal height.
        fix_class: (N,) of :class:`FixClass`.
        sigma_m: (N, 3) standard deviations east, north, up, as reported by the receiver.
        hdop, satellites: (N,) horizontal dilution of precision, and number of satellites used.
        correction_age_s: (N,) age of the differential corrections.
        line: (N,) line of the fix in the file, from 1.
        source: The file.
        skipped: Notes on what the reader skipped or assumed (damaged lines, missing geoid separations).
        correlation: (N, 3) correlations of the errors east and north, east and up, north and up, as reported;
            0 where there is no report. None in runs of version 0.1.
        logging_sigma_m: (N, 3) standard deviations of what logging added to the receiver's errors, by too few
            digits or uneven time stamps. None in runs of version 0.1.
        airborne: Whether the log is that of a camera which flies.
        doubts: Those of ``skipped`` that may move every pose.
    """

    t_s: FloatArray
    latitude_deg: FloatArray
    longitude_deg: FloatArray
    height_m: FloatArray
    fix_class: tuple[FixClass, ...]
    sigma_m: FloatArray
    hdop: FloatArray
    satellites: FloatArray
    correction_age_s: FloatArray
    line: IntArray
    source: Path
    skipped: tuple[str, ...] = ()
    correlation: FloatArray | None = None
    logging_sigma_m: FloatArray | None = None
    airborne: bool = False
    doubts: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def logging_sigma(self) -> FloatArray:
        """(N, 3) ``logging_sigma_m``, 0 where it is not known."""
        return np.zeros((len(self), 3)) if self.logging_sigma_m is None else self.logging_sigma_m

    def rows(self, rows: IntArray | BoolArray) -> "GpsLog":
        """Return the fixes of some rows, in the order given."""
        index = np.arange(len(self))[rows]
        columns: dict[str, Any] = {
            name: value[index] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return replace(self, **columns, fix_class=tuple(self.fix_class[row] for row in index))
