"""Epochs of an NMEA log: sentences with a place, joined with dates and sigmas, as fixes."""

from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vgps.crs import egm96
from vgps.model import FixClass, FloatArray
from vgps.readers.gps_formats.fixes import (
    DAY_S,
    NMEA_QUALITY,
    Clock,
    Fix,
    RawLog,
    counted,
    damaged_lines,
    skipped,
    with_a_height,
)

_SEPARATION_LIMIT_M = 3.0  # EGM96 is within about a metre of the geoid, receivers' coarser tables within two
# indicator of the mode in GNS, RMC and GLL, the best first; of N, E (estimated), M (manual) and S (simulated)
# there is no fix
_MODES = {
    "R": FixClass.RTK_FIX,
    "F": FixClass.RTK_FLOAT,
    "D": FixClass.DGPS,
    "P": FixClass.SINGLE,
    "A": FixClass.SINGLE,
}


@dataclass(kw_only=True)
class Epoch:
    """A sentence with a place and its DOP; ``day`` counts midnights since the log's first sentence."""

    order: int
    line: int
    day: int
    time_s: float
    message: Any
    hdop: float


@dataclass(frozen=True)
class Anchor:
    """A sentence with a date; ``day_zero_s`` is the midnight at which the log's day 0 would begin."""

    order: int
    day: int
    time_s: float
    day_zero_s: float


@dataclass(kw_only=True)
class Reading:
    """The sentences read so far."""

    epochs: list[Epoch] = field(default_factory=list)
    anchors: list[Anchor] = field(default_factory=list)
    sigmas: dict[tuple[int, int], tuple[float, float, float]] = field(default_factory=dict)
    damaged: list[int] = field(default_factory=list)
    untimed: int = 0
    untimed_empty: int = 0  # without a fix, either
    day: int = 0
    time_s: float | None = None


def epoch_key(day: int, time_s: float) -> tuple[int, int]:
    """Return what the sentences of an epoch have in common."""
    return day, round(time_s * 1000)


def number_of(message: Any, name: str) -> float:
    """Return a field of a sentence; NaN if it is empty or no number."""
    value = getattr(message, name, "")
    return float(value) if isinstance(value, int | float) else np.nan


def fix_class_of(message: Any) -> FixClass | None:
    """Return the class of a GGA, GNS, RMC or GLL; None without a fix."""
    quality = number_of(message, "quality")
    if quality > 0:
        return NMEA_QUALITY.get(int(quality), FixClass.UNKNOWN)
    # GNS has a mode for each constellation and no status, old RMC and GLL have no mode
    modes = str(getattr(message, "posMode", ""))
    if getattr(message, "status", "") == "A":
        modes = modes or "A"
    elif message.msgID != "GNS":
        return None
    return next((kind for mode, kind in _MODES.items() if mode in modes), None)


def log_of(reading: Reading) -> RawLog:
    """Return the fixes of the epochs that have one, and notes on the others and on heights."""
    with_fix = [epoch for epoch in reading.epochs if fix_class_of(epoch.message) is not None]
    filled, about_heights = _separations(with_fix)
    fixes = [
        _fix(epoch, reading, separation) for epoch, separation in zip(with_fix, filled.tolist(), strict=True)
    ]
    fixes, about_none = with_a_height(fixes)
    notes = [
        *damaged_lines(reading.damaged),
        *skipped(len(reading.epochs) - len(with_fix) + reading.untimed_empty, "epoch", "without a fix"),
        *skipped(reading.untimed, "fix", "without a time of day"),
    ]
    clock = Clock.UTC if reading.anchors else Clock.TIME_OF_DAY
    return RawLog(clock, fixes, [*notes, *about_heights], doubts=about_none)


def _separations(epochs: list[Epoch]) -> tuple[FloatArray, list[str]]:
    """Return (N,) geoid separations, and notes on those that are missing or contradict EGM96."""
    heights, separations = (
        np.array([number_of(epoch.message, name) for epoch in epochs]) for name in ("alt", "sep")
    )
    if not np.isfinite(heights).any():
        return np.zeros(len(epochs)), []
    model = _model_separations(epochs)
    known = np.isfinite(separations)
    instead = np.full(len(epochs), np.median(separations[known])) if known.any() else model
    notes = []
    if not known.all():
        source = "as in the others" if known.any() else "from EGM96: heights may be wrong by a metre"
        height = f"{np.nanmedian(instead):g} m" if known.any() else f"{np.nanmedian(instead):.1f} m"
        notes.append(
            f"{counted(int((~known).sum()), 'fix')} without geoid separation, taken as {height} {source}"
        )
    return np.where(known, separations, instead), notes + _contradiction(separations[known], model[known])


def _model_separations(epochs: list[Epoch]) -> FloatArray:
    """Return (N,) heights of EGM96 at the fixes; NaN where a position is impossible."""
    place = np.array([[number_of(epoch.message, name) for name in ("lat", "lon")] for epoch in epochs])
    place = place.reshape(-1, 2)
    place[(np.abs(place) > (90.0, 360.0)).any(axis=1)] = np.nan
    return egm96().height_m(*place.T)


def _contradiction(separations: FloatArray, model: FloatArray) -> list[str]:
    """Return a note if the receiver's geoid separations are not those of a geoid."""
    difference = separations - model
    if not np.isfinite(difference).any() or abs(np.nanmedian(difference)) < _SEPARATION_LIMIT_M:
        return []
    return [
        f"the receiver's geoid separation, {np.median(separations):.1f} m, contradicts EGM96's "
        f"{np.nanmedian(model):.1f} m: heights are right if the receiver subtracts the same from its own, "
        "else wrong by the difference"
    ]


def _fix(epoch: Epoch, reading: Reading, separation_m: float) -> Fix:
    message = epoch.message
    return Fix(
        t_s=_day_zero(epoch, reading.anchors) + epoch.day * DAY_S + epoch.time_s,
        latitude_deg=number_of(message, "lat"),
        longitude_deg=number_of(message, "lon"),
        height_m=number_of(message, "alt") + separation_m,
        fix_class=fix_class_of(message) or FixClass.UNKNOWN,
        line=epoch.line,
        sigma_m=reading.sigmas.get(epoch_key(epoch.day, epoch.time_s), (np.nan, np.nan, np.nan)),
        hdop=epoch.hdop,
        satellites=number_of(message, "numSV"),
        correction_age_s=number_of(message, "diffAge"),
    )


def _day_zero(epoch: Epoch, anchors: list[Anchor]) -> float:
    """Return the midnight of day 0: from the date in the same epoch, else before it, else after it."""
    if not anchors:
        return 0.0
    after = bisect_right(anchors, epoch.order, key=lambda anchor: anchor.order)
    following = anchors[after] if after < len(anchors) else None
    if following is not None and (
        after == 0 or epoch_key(following.day, following.time_s) == epoch_key(epoch.day, epoch.time_s)
    ):
        return following.day_zero_s
    return anchors[after - 1].day_zero_s
