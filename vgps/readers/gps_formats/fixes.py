"""Common parts of the GPS formats, before a log is put on the video's clock."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from vgps.crs import egm96
from vgps.geodesy import to_enu
from vgps.model import FixClass, FloatArray, GeodeticPoint
from vgps.readers.gps_formats.last_digits import LastDigits

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
DAY_S = 86400.0
_NO_HEIGHT_SIGMA_M = 1000.0  # of a height that is unknown: higher than drones fly above their start
_NO_HEIGHTS = f"no heights: fixes are horizontal, at height 0 with a sigma of {_NO_HEIGHT_SIGMA_M:g} m"
_ABOVE_SEA = "heights are above the sea: EGM96's {:.1f} m were added, they may be wrong by some metres"
_SHARE_OF_AN_AXIS = 2.0**-0.5  # of a horizontal accuracy
_PAIRS = (0, 0, 1), (1, 2, 2)  # of axes that have a correlation
_LEAST_SHARE = 1e-3  # of the largest, below which an eigenvalue of correlations is rounding or damage
_STILL_S = 1.0  # a position repeated for longer than this is a new fix
_STANDING_START_M_S2 = (
    10.0  # nothing that carries a camera drives off faster: tyres and rotors lift about 1 g
)
HIGHEST_M = 1e8  # beyond the orbits of all navigation satellites; no position is that high

# quality indicator of an NMEA GGA sentence; 0 and empty mean no fix
NMEA_QUALITY = {
    1: FixClass.SINGLE,
    2: FixClass.DGPS,
    3: FixClass.SINGLE,  # PPS
    4: FixClass.RTK_FIX,
    5: FixClass.RTK_FLOAT,
    6: FixClass.UNKNOWN,  # dead reckoning
    7: FixClass.UNKNOWN,  # manual input
    8: FixClass.UNKNOWN,  # simulator
    9: FixClass.SBAS,
}


Triple = tuple[float, float, float]


class Clock(Enum):
    """Origin of a log's times."""

    UTC = auto()  # 1970-01-01, without leap seconds
    TIME_OF_DAY = auto()  # an unknown midnight UTC: the log has no date
    VIDEO = auto()  # the video's first frame


class Fix(NamedTuple):
    """One fix; NaN where unknown. ``sigma_m`` is east, north, up; ``correlation`` of en, eu, nu, else 0.

    ``geoid_m`` is what was added to a height above the sea; ``logging_sigma_m`` is that of
    :class:`~vgps.model.GpsLog`, or NaN, where the last digits tell it.
    """

    t_s: float
    latitude_deg: float
    longitude_deg: float
    height_m: float
    fix_class: FixClass
    line: int
    sigma_m: Triple = (np.nan, np.nan, np.nan)
    hdop: float = np.nan
    satellites: float = np.nan
    correction_age_s: float = np.nan
    correlation: Triple = (0.0, 0.0, 0.0)
    geoid_m: float = 0.0
    logging_sigma_m: Triple = (np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class RawLog:
    """Fixes in the order of the file, their clock, notes on what was skipped or assumed; whether they fly.

    ``doubts`` are notes on what may move every pose: the run warns of them.
    """

    clock: Clock
    fixes: list[Fix]
    notes: list[str] = field(default_factory=list)
    airborne: bool = False
    doubts: list[str] = field(default_factory=list)


def unix_s(instant: datetime) -> float:
    """Return seconds from 1970-01-01 UTC; a naive instant is UTC."""
    aware = instant if instant.tzinfo else instant.replace(tzinfo=UTC)
    return (aware - EPOCH).total_seconds()


def unix_day_s(day: date) -> float:
    """Return seconds from 1970-01-01 to the midnight at which a day begins."""
    return (day - EPOCH.date()).days * DAY_S


def sigmas_and_correlations(covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return standard deviations and correlations (en, eu, nu), (N, 3) each, of covariances (N, 3, 3).

    A negative variance gives NaN. Correlations that no covariance has give 0: those of unknown variances, and
    of numbers that are rounded too far or damaged.
    """
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    sigma = np.sqrt(np.where(variance >= 0.0, variance, np.nan))
    with np.errstate(divide="ignore", invalid="ignore"):  # zero
        ratio = covariance / (sigma[:, :, None] * sigma[:, None, :])
    known = np.isfinite(ratio).all(axis=(1, 2))
    share = np.linalg.eigvalsh(np.where(known[:, None, None], ratio, np.eye(3)))
    known &= share[:, 0] > _LEAST_SHARE * share[:, 2]
    return sigma, np.where(known[:, None], ratio[:, *_PAIRS], 0.0)


def uncertainty(covariance: FloatArray) -> tuple[Triple, Triple]:
    """Return standard deviations and correlations of a covariance (3, 3); a variance of 0 is unknown too."""
    known = covariance + np.diag(np.where(np.diagonal(covariance) > 0.0, 0.0, np.nan))
    (sigma,), (correlation,) = sigmas_and_correlations(known[None])
    return (*sigma.tolist(),), (*correlation.tolist(),)


def axis_sigmas(horizontal_m: float, vertical_m: float = np.nan) -> Triple:
    """Return sigmas east, north, up [m]; a horizontal accuracy is that of both axes, 0 and less unknown."""
    axis_m = horizontal_m * _SHARE_OF_AN_AXIS if horizontal_m > 0.0 else np.nan
    return axis_m, axis_m, vertical_m if vertical_m > 0.0 else np.nan


def damaged_lines(lines: list[int]) -> list[str]:
    """Return a note on damaged lines, or none."""
    if not lines:
        return []
    return [f"{counted(len(lines), 'damaged or truncated line')} skipped, first line {min(lines)}"]


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: ``1 fix``, ``2 fixes``, ``3 lines``."""
    if number == 1:
        return f"1 {noun}"
    return f"{number} {noun}es" if noun.endswith("x") else f"{number} {noun}s"


def skipped(number: int, noun: str, why: str = "") -> list[str]:
    """Return a note on what was skipped, or none: ``2 epochs without a fix skipped``."""
    return [f"{counted(number, noun)}{why and ' ' + why} skipped"] if number else []


def repeats(fix: Fix, before: Fix) -> bool:
    """Return whether a fix states the place of the one before it again, in less than a second."""
    return before[1:3] == fix[1:3] and fix.t_s - before.t_s < _STILL_S


def without_repeats(fixes: list[Fix], what: str) -> tuple[list[Fix], list[str]]:
    """Return the fixes with a new position, or the same one for another second, and a note on the others.

    Recordings that state the position with every frame repeat it until the receiver has another one.

    Args:
        fixes: In order of time.
        what: Noun for what has the positions.
    """
    kept: list[Fix] = []
    for fix in fixes:
        if not kept or not repeats(fix, kept[-1]):
            kept.append(fix)
    return kept, skipped(len(fixes) - len(kept), what, "with a repeated position")


def without_held(fixes: list[Fix]) -> tuple[list[Fix], list[str]]:
    """Return the fixes without repeats of a position that was out of date, and a note on these.

    A log with more epochs than its receiver has positions, as a phone's or one of a receiver that hangs,
    repeats each position until the next. So does one that stands, but its next position is no farther than
    it can have driven since the last repeat, and a step of the log's last digits. Repeats that end the log
    are judged as the others.

    Args:
        fixes: In order of time.
    """
    t_s, *place = np.array([fix[:4] for fix in fixes], float).reshape(-1, 4).T
    leaves = np.flatnonzero(
        np.any(np.diff(place) != 0.0, axis=0)
    )  # the last fix at each position but the last
    if len(leaves) in (0, len(fixes) - 1):
        return fixes, []
    move_m = np.linalg.norm(np.diff(to_enu(GeodeticPoint(*fixes[0][1:4]), *place), axis=0)[leaves], axis=1)
    step_m = float(np.hypot(*last_digits(fixes).steps_m[:2]))
    possible_m = 0.5 * _STANDING_START_M_S2 * np.diff(t_s)[leaves] ** 2 + step_m
    position = np.searchsorted(leaves, np.arange(len(fixes)))
    repeats = np.diff(position, prepend=-1) == 0
    held = repeats & np.append(move_m > possible_m, False)[position]
    held |= repeats & (position == len(leaves)) & held.any()
    kept = [fix for fix, old in zip(fixes, held.tolist(), strict=True) if not old]
    return kept, skipped(int(held.sum()), "fix", "that repeated a position out of date")


def last_digits(fixes: Sequence[Fix]) -> LastDigits:
    """Return the last digits of fixes as their log states them."""
    latitude_deg, longitude_deg, height_m = np.array([fix[1:4] for fix in fixes], float).reshape(-1, 3).T
    return LastDigits().add(latitude_deg, longitude_deg, height_m - [fix.geoid_m for fix in fixes])


def with_a_height(fixes: list[Fix]) -> tuple[list[Fix], list[str]]:
    """Return fixes at height 0 with a large sigma and a note if none has a height, else as they are.

    Programs that know no heights write 0 or nothing.
    """
    if not fixes or any(np.isfinite(fix.height_m) and fix.height_m for fix in fixes):
        return fixes, []
    flat = [fix._replace(height_m=0.0, sigma_m=(*fix.sigma_m[:2], _NO_HEIGHT_SIGMA_M)) for fix in fixes]
    return flat, [_NO_HEIGHTS]


def has_height(fix: Fix) -> bool:
    """Whether a fix has a height of its own, or the large sigma of `with_a_height`."""
    return fix.sigma_m[2] != _NO_HEIGHT_SIGMA_M


def from_sea_level(fixes: list[Fix]) -> tuple[list[Fix], list[str]]:
    """Return fixes whose heights are above the sea with ellipsoidal ones, by EGM96, and a note on it."""
    place = np.array([fix[1:4] for fix in fixes], float).reshape(-1, 3)
    good = (np.abs(place[:, 0]) <= 90) & (np.abs(place[:, 1]) <= 360) & np.isfinite(place[:, 2])
    if not good.any():
        return fixes, []
    separation = np.zeros(len(fixes))
    separation[good] = egm96().height_m(place[good, 0], place[good, 1])
    raised = [
        fix._replace(height_m=fix.height_m + added, geoid_m=added)
        for fix, added in zip(fixes, separation.tolist(), strict=True)
    ]
    return raised, [_ABOVE_SEA.format(float(np.median(separation[good])))]
