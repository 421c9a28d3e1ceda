"""What sensors and surveyors wrote down: fixes, rates, forces, marks of known position."""

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

    def __len__(self) -> int:
        return len(self.t_s)

    def rows(self, rows: IntArray | BoolArray) -> "GpsLog":
        """Return the fixes of some rows, in the order given."""
        index = np.arange(len(self))[rows]
        columns: dict[str, Any] = {
            name: value[index] for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        return replace(self, **columns, fix_class=tuple(self.fix_class[row] for row in index))


@dataclass(frozen=True)
class GyroLog:
    """Angular rates in the gyro's own axes, corrected by the rig: ``t_s`` (N,), ``rate_rad_s`` (N, 3)."""

    t_s: FloatArray
    rate_rad_s: FloatArray
    source: Path


@dataclass(frozen=True, kw_only=True)
class ImuLog:
    """Angular rates and specific force in the IMU's axes, on the video's clock.

    Attributes:
        t_s: (N,) strictly ascending.
        rate_rad_s: (N, 3).
        force_m_s2: (N, 3) specific force: acceleration minus gravity, upward at rest.
        saturated: (N,) samples at the end of the sensor's range.
        source: The file.
        notes: What the reader found: gaps, saturation.
    """

    t_s: FloatArray
    rate_rad_s: FloatArray
    force_m_s2: FloatArray
    saturated: BoolArray
    source: Path
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ControlPoints:
    """Control and check points: marks of known world position observed in frames, a row per observation.

    Control points start a run in Kume 2010 and hold it; check points only judge it.

    Attributes:
        name: (N,) the mark.
        frame: (N,) frame index of the observation.
        uv_px: (N, 2) observation in the distorted image.
        world_p_point: (N, 3) ENU metres, or latitude, longitude [deg], ellipsoidal height [m] if geodetic.
        sigma_m: (N, 3) standard deviations of the position east, north, up; 0 if it counts as exact.
        check: (N,) whether the mark is a check point.
        geodetic: Whether the positions are geodetic.
        source: The file.
        notes: What was assumed of the coordinates.
    """

    name: tuple[str, ...]
    frame: IntArray
    uv_px: FloatArray
    world_p_point: FloatArray
    sigma_m: FloatArray
    check: BoolArray
    geodetic: bool
    source: Path
    notes: tuple[str, ...] = ()
