"""GPS logs of any format, recognised by content, on the video's clock, cleaned and in order of time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgps.errors import GpsLogError
from vgps.geodesy import to_enu
from vgps.model import FixClass, GeodeticPoint, GpsLog, Rig
from vgps.readers.bag import looks_like_bag, read_bag_fixes
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.gps_formats.android import looks_like_android, read_android
from vgps.readers.gps_formats.csrs import looks_like_csrs, read_csrs
from vgps.readers.gps_formats.fit import looks_like_fit, read_fit
from vgps.readers.gps_formats.fixes import (
    DAY_S,
    HIGHEST_M,
    Clock,
    Fix,
    RawLog,
    counted,
    last_digits,
    unix_s,
    without_held,
)
from vgps.readers.gps_formats.gps_csv import looks_like_gps_csv, read_gps_csv
from vgps.readers.gps_formats.gpx import looks_like_gpx, read_gpx
from vgps.readers.gps_formats.igc import looks_like_igc, read_igc
from vgps.readers.gps_formats.interpolated import without_interpolated
from vgps.readers.gps_formats.last_digits import LastDigits
from vgps.readers.gps_formats.mavlink import looks_like_mavlink, read_mavlink
from vgps.readers.gps_formats.nmea import looks_like_nmea, looks_like_nmea_without_gga, read_nmea
from vgps.readers.gps_formats.novatel import looks_like_novatel, read_novatel
from vgps.readers.gps_formats.rtklib import looks_like_pos, read_pos
from vgps.readers.gps_formats.sbf import looks_like_sbf, read_sbf
from vgps.readers.gps_formats.ubx import looks_like_old_ubx, looks_like_ubx, read_old_ubx, read_ubx
from vgps.readers.gps_formats.ulog import looks_like_ulog, read_ulog
from vgps.readers.gps_formats.uneven_times import fix_times
from vgps.readers.gps_formats.unread import remedy
from vgps.readers.gps_formats.xml_tracks import looks_like_xml_track, read_xml_track
from vgps.readers.table import read_bytes
from vgps.readers.video_gps.dji_srt import looks_like_srt, read_dji_srt
from vgps.readers.video_gps.find import looks_like_video, read_video_gps

_SAME_TIME_S = 1e-6
_COARSE_M = 0.1  # steps of last digits that are larger than most errors of RTK-fixes
_MANY = 10  # fixes that are no round numbers by chance
_RTK = {FixClass.RTK_FIX, FixClass.RTK_FLOAT}


class UnknownStartError(GpsLogError):
    """A log in UTC, and nothing says when the video began."""


@dataclass(frozen=True)
class _Format:
    name: str
    matches: Callable[[bytes], bool]
    read: Callable[[bytes, Path], RawLog]


_FORMATS = (
    _Format("ulog", looks_like_ulog, read_ulog),
    _Format("mavlink", looks_like_mavlink, read_mavlink),
    _Format("fit", looks_like_fit, read_fit),
    _Format("bag", looks_like_bag, lambda _, path: read_bag_fixes(path)),
    _Format("sbf", looks_like_sbf, read_sbf),
    _Format("novatel", looks_like_novatel, read_novatel),
    _Format("ubx", looks_like_ubx, lambda data, _: read_ubx(data)),
    _Format("gpx", looks_like_gpx, read_gpx),
    _Format("nmea", looks_like_nmea, lambda data, _: read_nmea(data)),
    _Format("ubx", looks_like_old_ubx, lambda data, _: read_old_ubx(data)),
    _Format("pos", looks_like_pos, read_pos),
    _Format("csrs", looks_like_csrs, lambda data, _: read_csrs(data)),
    _Format("igc", looks_like_igc, read_igc),
    _Format("srt", looks_like_srt, read_dji_srt),
    _Format("track", looks_like_xml_track, read_xml_track),
    _Format("android", looks_like_android, lambda data, _: read_android(data)),
    _Format("csv", looks_like_gps_csv, lambda _, path: read_gps_csv(path)),
    _Format("nmea", looks_like_nmea_without_gga, lambda data, _: read_nmea(data)),
)


def gps_format(path: str | Path) -> str | None:
    """Return the name of a log's format (``ubx``, ``gpx``, ``nmea``, ...) by its content; None if unknown."""
    try:
        data = Path(path).read_bytes()
    except OSError:
        return None
    return next((form.name for form in _FORMATS if form.matches(data)), None)


def read_gps_log(path: str | Path, rig: Rig | None = None, telemetry: Telemetry | None = None) -> GpsLog:
    """Read a GPS log of any format that the README of this room lists, recognised by content.

    Args:
        path: The file.
        rig: Its ``video_start_utc`` puts UTC times on the video's clock; a log without a date gets the
            nearest day. Without a rig (a log without a video), times count from the first fix.
        telemetry: The file's own, if it is a GoPro's video that has already been read.

    Returns:
        Fixes in order of time; ``skipped`` lists what was dropped.

    Raises:
        GpsLogError: The file is missing, empty, of no known format, without a usable fix or known fix class,
            or in UTC while the rig has no ``video_start_utc``.
    """
    path = Path(path)
    return gps_log(_read(path) if telemetry is None else read_video_gps(path, telemetry), rig, path)


def gps_log(raw: RawLog, rig: Rig | None, path: Path) -> GpsLog:
    """Return the fixes of a log on the video's clock, in order and without impossible ones.

    Raises:
        GpsLogError: As from :func:`read_gps_log`.
    """
    notes = [*raw.doubts, *raw.notes]
    fixes = _in_order(_with_position(raw.fixes, notes), notes)
    if not fixes:
        raise GpsLogError(_with_notes("no fix with a position", notes), file=path, expected="at least one")
    if all(fix.fix_class is FixClass.UNKNOWN for fix in fixes):
        raise GpsLogError(
            _with_notes(f"none of {len(fixes)} fixes has a known class", notes),
            file=path,
            expected=", ".join(kind for kind in FixClass if kind is not FixClass.UNKNOWN),
        )
    if raw.clock is Clock.TIME_OF_DAY and rig is not None:
        notes.append("the log has no date: its day is the one nearest to the video's start")
    log = _log(fixes, _start(raw.clock, fixes, rig, path), notes, path)
    log = replace(log, airborne=raw.airborne, doubts=tuple(raw.doubts))
    return _as_logged(log, last_digits(fixes))


def _read(path: Path) -> RawLog:
    if looks_like_video(_head(path)):
        return read_video_gps(path)
    data = read_bytes(path, GpsLogError)
    form = next((form for form in _FORMATS if form.matches(data)), None)
    if form is None:
        raise GpsLogError(
            "not a GPS log of a known format",
            file=path,
            expected="UBX with NAV-PVT, SBF, NovAtel with BESTPOS, NMEA, GPX, TCX, KML with gx:Track, an "
            "RTKLIB .pos, IGC, FIT, MAVLink, ULog, a ROS bag, DJI subtitles, a log of GnssLogger, a video "
            "with GPS, or a CSV with latitude_deg and longitude_deg",
            remedy=remedy(data),
        )
    return form.read(data, path)


def _head(path: Path) -> bytes:
    try:
        with path.open("rb") as stream:
            return stream.read(16)
    except OSError:
        return b""  # reading the whole file raises the error


def _with_notes(found: str, notes: list[str]) -> str:
    return f"{found} ({'; '.join(notes)})" if notes else found


def _with_position(fixes: list[Fix], notes: list[str]) -> list[Fix]:
    place = np.array([fix[:4] for fix in fixes], float).reshape(-1, 4)
    t_s, latitude, longitude, height = place.T
    good = (
        np.isfinite(t_s)
        & (np.abs(latitude) <= 90)
        & (np.abs(longitude) <= 360)
        & (np.abs(height) <= HIGHEST_M)
    )
    if not good.all():
        line = fixes[int(np.flatnonzero(~good)[0])].line
        swapped = (np.abs(latitude) > 90) & (np.abs(latitude) <= 180) & (np.abs(longitude) <= 90)
        dropped = (
            f"{counted(int((~good).sum()), 'fix')} without a possible position dropped, first line {line}"
        )
        notes.append(dropped + "; latitude and longitude seem to be swapped" * bool(swapped.all()))
    return [fix for fix, keep in zip(fixes, good, strict=True) if keep]


def _in_order(fixes: list[Fix], notes: list[str]) -> list[Fix]:
    ordered = sorted(fixes, key=lambda fix: fix.t_s)
    if ordered != fixes:
        notes.append("fixes were not in order of time; sorted")
    gaps = np.diff([fix.t_s for fix in ordered], prepend=-np.inf)
    once = [fix for fix, gap in zip(ordered, gaps, strict=True) if gap > _SAME_TIME_S]
    if len(once) < len(ordered):
        notes.append(f"{counted(len(ordered) - len(once), 'fix')} at the time of another dropped")
    current, about_held = without_held(once)
    own, about_others = without_interpolated(current)
    notes += about_held + about_others
    return own


def _start(clock: Clock, fixes: list[Fix], rig: Rig | None, path: Path) -> float:
    """Return the time of the video's first frame on the log's clock."""
    if rig is None:
        return fixes[0].t_s
    if clock is Clock.VIDEO:
        return 0.0
    if rig.video_start_utc is None:
        raise UnknownStartError(
            "times are in UTC, but the video's start in UTC is unknown",
            file=path,
            remedy="set it in rig.yaml, as video_start_utc: 2026-05-01T09:30:12.5+00:00",
        )
    start = unix_s(rig.video_start_utc)
    if clock is Clock.TIME_OF_DAY:
        # the day on which the log's first fix is closest to the video's start
        start -= DAY_S * round((start - fixes[0].t_s) / DAY_S)
    return start


def _as_logged(log: GpsLog, digits: LastDigits) -> GpsLog:
    """Return the log with what digits and time stamps add to the errors of the receiver."""
    origin = GeodeticPoint(float(log.latitude_deg[0]), float(log.longitude_deg[0]), float(log.height_m[0]))
    place_m = to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m)
    times = fix_times(log.t_s, place_m[:, :2])
    moved_m = times.sigma_s * np.gradient(place_m, times.t_s, axis=0) if times.sigma_s else 0.0
    return replace(
        log,
        t_s=times.t_s,
        logging_sigma_m=np.hypot(digits.rounding_m, np.broadcast_to(moved_m, place_m.shape)),
        skipped=(*log.skipped, *_about_digits(log, digits), *times.notes),
        doubts=(*log.doubts, *times.notes),
    )


def _about_digits(log: GpsLog, digits: LastDigits) -> list[str]:
    """Return a note if digits that the log lacks cost accuracy that its receiver had."""
    plane_m, up_m = float(digits.steps_m[:2].max()), float(digits.steps_m[2])
    if np.ptp(log.height_m) == 0.0:  # nothing measured it
        up_m = 0.0
    if _RTK.isdisjoint(log.fix_class) or len(log) < _MANY or max(plane_m, up_m) < _COARSE_M:
        return []
    steps = f"{plane_m:.2g} m in the plane and {up_m:.2g} m in height"
    return [f"the last digits of the positions are steps of {steps}, which count as errors: log more digits"]


def _log(fixes: list[Fix], start_s: float, notes: list[str], path: Path) -> GpsLog:
    longitude = np.array([fix.longitude_deg for fix in fixes])
    return GpsLog(
        t_s=np.array([fix.t_s for fix in fixes]) - start_s,
        latitude_deg=np.array([fix.latitude_deg for fix in fixes]),
        longitude_deg=np.where(np.abs(longitude) > 180, (longitude + 180) % 360 - 180, longitude),
        height_m=np.array([fix.height_m for fix in fixes]),
        fix_class=tuple(fix.fix_class for fix in fixes),
        sigma_m=np.array([fix.sigma_m for fix in fixes], float),
        hdop=np.array([fix.hdop for fix in fixes]),
        satellites=np.array([fix.satellites for fix in fixes]),
        correction_age_s=np.array([fix.correction_age_s for fix in fixes]),
        line=np.array([fix.line for fix in fixes], np.int64),
        source=path,
        skipped=tuple(notes),
        correlation=np.array([fix.correlation for fix in fixes], float),
    )
