"""Sources of GPS errors: those of real receivers replayed on a true path, and logs of recordings."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from zlib import crc32

import numpy as np

from scripts.common.drives import Drive
from scripts.common.receivers import LATE_UBLOX_S, Series, rtk_drive, septentrio, survey, ublox
from vgps.geodesy import to_geodetic
from vgps.model import FixClass, GpsLog, IntArray

ENDS_SHARE = 0.15  # of a replayed log at either end is RTK-fix where its source begins and ends so
SEEN = ("survey", "simulated")  # the default regions and the simulator's errors were chosen by this receiver


def stretch(among: IntArray, count: int, rng: np.random.Generator) -> IntArray:
    """Return consecutive epochs (count,) from a random one on; a series that is too short turns back.

    Args:
        among: (N,) epochs to choose from, N >= 2.
        count: How many.
        rng: Chooses the first.
    """
    first = int(rng.integers(max(len(among) - count, 0) + 1))
    period = 2 * (len(among) - 1)
    at = (first + np.arange(count)) % period
    return among[np.minimum(at, period - at)]


def as_it_comes(series: Series, count: int, rng: np.random.Generator) -> IntArray:
    """Return a stretch of the series with its own changes of class."""
    return stretch(np.arange(len(series.errors.t_s)), count, rng)


def of_one_class(fix_class: FixClass, series: Series, count: int, rng: np.random.Generator) -> IntArray:
    """Return a stretch of the epochs of one class, which follow each other across gaps."""
    return stretch(series.of_class(fix_class), count, rng)


def float_between_fixes(series: Series, count: int, rng: np.random.Generator) -> IntArray:
    """Return RTK-fix at both ends and RTK-float between them, as the log of a drive through a street."""
    ends = max(round(ENDS_SHARE * count), 2)
    fixed = stretch(series.of_class(FixClass.RTK_FIX), 2 * ends, rng)
    between = stretch(series.of_class(FixClass.RTK_FLOAT), max(count - 2 * ends, 0), rng)
    return np.concatenate([fixed[:ends], between, fixed[ends:]])[:count]


@dataclass(frozen=True, kw_only=True)
class Replayed:
    """A source of errors: whose, from which file, and which epochs of them."""

    receiver: str
    read: Callable[[Path], Series]
    choose: Callable[[Series, int, np.random.Generator], IntArray]


REPLAYED = {
    "survey_fix": Replayed(receiver="survey", read=survey, choose=partial(of_one_class, FixClass.RTK_FIX)),
    "survey_float": Replayed(
        receiver="survey", read=survey, choose=partial(of_one_class, FixClass.RTK_FLOAT)
    ),
    "survey_mixed": Replayed(receiver="survey", read=survey, choose=float_between_fixes),
    "septentrio": Replayed(receiver="septentrio", read=septentrio, choose=as_it_comes),
    "ublox": Replayed(receiver="ublox", read=ublox, choose=as_it_comes),
    "rtk_drive": Replayed(receiver="rtk_drive", read=rtk_drive, choose=as_it_comes),
    "rtk_drive_mixed": Replayed(receiver="rtk_drive", read=rtk_drive, choose=float_between_fixes),
}
LOGS = "logs"

_FLOAT_LOGS = ("gps_fix", "gps_float", "gps_float_b", "gps_outliers", "gps_late")
_RECEIVERS = {
    **{("kitti03", f"{name}.nmea"): "survey" for name in _FLOAT_LOGS},
    ("kitti03", "kitti03_more/gps_moving.nmea"): "septentrio",
    ("kitti03", "kitti03_more/gps_single.nmea"): "ublox",
    ("kitti07", "gps_fix.nmea"): "static, no survey",
    ("kitti07", "gps_float.nmea"): "static, no survey",
    ("kitti07", "gps_float_only.nmea"): "static, no survey",
    ("kitti07", "gps_moving.nmea"): "septentrio",
    ("kitti07", "gps_ublox.nmea"): "ublox",
    ("kitti07", "gps_single.nmea"): "random walk",
}
_LATE_S = {
    "gps_late.nmea": 0.37,
    "kitti03_more/gps_single.nmea": LATE_UBLOX_S,
    "gps_ublox.nmea": LATE_UBLOX_S,
}


@dataclass(frozen=True)
class Errors:
    """A log on a drive, whose errors it has, and how much older its positions are than their stamps."""

    log: GpsLog
    receiver: str
    late_s: float

    @property
    def seen(self) -> bool:
        """Whether the default regions were chosen by errors of this receiver."""
        return self.receiver in SEEN

    @property
    def mixed(self) -> bool:
        """Whether the log holds RTK-fixes and others."""
        classes = set(self.log.fix_class)
        return FixClass.RTK_FIX in classes and len(classes) > 1


def make_errors(source: str, drive: Drive, data: Path, seed: int) -> Errors:
    """Return a source's log on a drive.

    Args:
        source: A name in ``REPLAYED``, or a log that ships with the drive.
        drive: Where the antenna truly was.
        data: Folder of the receivers' logs.
        seed: Chooses the stretch that is replayed, another on each drive; a shipped log is always the same.

    Raises:
        GpsLogError: A log cannot be read.
    """
    if source not in REPLAYED:
        unknown = "simulated" if (drive.folder / "simulation.yaml").exists() else "unknown"
        receiver = _RECEIVERS.get((drive.folder.name, source), unknown)
        return Errors(drive.read_log(drive.shipped()[source]), receiver, _LATE_S.get(source, 0.0))
    chosen = REPLAYED[source]
    series = read_series(source, data)
    rng = np.random.default_rng([seed, crc32(f"{Path(drive.name).name} {source}".encode())])
    return Errors(replayed(series, chosen.choose, drive, rng), chosen.receiver, series.late_s)


@cache
def read_series(source: str, data: Path) -> Series:
    """Return the errors behind a name in ``REPLAYED``."""
    return REPLAYED[source].read(data)


def replayed(
    series: Series,
    choose: Callable[[Series, int, np.random.Generator], IntArray],
    drive: Drive,
    rng: np.random.Generator,
) -> GpsLog:
    """Return fixes at the series' interval, each the true antenna plus one epoch's error.

    The first comes at a random time within the first interval, so that fixes lie between frames.
    """
    first_s = rng.uniform(series.late_s, series.late_s + series.step_s)
    t_s = np.arange(first_s, drive.duration_s, series.step_s)
    rows = choose(series, len(t_s), rng)
    position = drive.true_antenna(t_s - series.late_s) + series.errors.error_m[rows]
    latitude_deg, longitude_deg, height_m = to_geodetic(drive.origin, position).T
    return GpsLog(
        t_s=t_s,
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        height_m=height_m,
        fix_class=tuple(series.errors.fix_class[row] for row in rows),
        sigma_m=series.errors.sigma_m[rows],
        hdop=series.hdop[rows],
        satellites=series.satellites[rows],
        correction_age_s=series.correction_age_s[rows],
        line=np.arange(1, len(t_s) + 1),
        source=series.errors.source,
    )
