"""Poses as NMEA 0183, for programs that expect a receiver.

GGA and GST are of the camera's centre, HDT is the heading of its axis. The quality of GGA says what the pose
is: 4 (RTK-fix) and 5 (RTK-float) where 95 % of its errors in the plane, by its stated sigmas, lie within the
region of that class, 1 where they do not, 6 (estimated) where it is bridged without features, 0 without one.
A pose has no satellites and no dilution of precision: these stay empty.
"""

from collections.abc import Iterator
from datetime import datetime, timedelta

import numpy as np
from pynmeagps import calc_checksum

from vgps.config import GpsConfig
from vgps.crs.geoid import Geoid
from vgps.geodesy import heading_deg, to_geodetic
from vgps.gps.regions import INSIDE_PLANE
from vgps.model import FixClass
from vgps.online.estimate import OnlineEstimate, OnlineState

_NO_POSE, _SINGLE, _FIX, _FLOAT, _ESTIMATED = 0, 1, 4, 5, 6


def sentences(estimate: OnlineEstimate, start_utc: datetime | None, geoid: Geoid, config: GpsConfig) -> bytes:
    """Return the sentences of an estimate.

    Args:
        estimate: Its best estimate, ``global_T_camera``, is sent.
        start_utc: UTC of the first frame; without it the times stay empty.
        geoid: Gives altitude and separation, whose sum is the height above the ellipsoid.
        config: Regions of the fix classes.
    """
    return b"".join(_framed(body) for body in _bodies(estimate, _time(estimate, start_utc), geoid, config))


def _bodies(estimate: OnlineEstimate, time: str, geoid: Geoid, config: GpsConfig) -> Iterator[str]:
    if not estimate.posed or estimate.world_origin is None:
        yield f"GNGGA,{time},,,,,{_NO_POSE},,,,,,,,"
        return
    pose = estimate.global_T_camera
    latitude, longitude, height_m = to_geodetic(estimate.world_origin, pose[:3, 3]).tolist()
    geoid_m = float(geoid.height_m(latitude, longitude))
    place = f"{_angle(latitude, 2)},{'NS'[latitude < 0]},{_angle(longitude, 3)},{'EW'[longitude < 0]}"
    altitude = f"{height_m - geoid_m:.3f},M,{geoid_m:.3f},M"
    yield f"GNGGA,{time},{place},{_quality(estimate, config)},,,{altitude},,"
    east, north, up = (f"{sigma:.3f}" if np.isfinite(sigma) else "" for sigma in estimate.sigma_position_m)
    yield f"GNGST,{time},,,,,{north},{east},{up}"
    heading = float(heading_deg(pose))
    if np.isfinite(heading):  # not straight up or down
        yield f"GNHDT,{round(heading, 3) % 360.0:.3f},T"


def _quality(estimate: OnlineEstimate, config: GpsConfig) -> int:
    if estimate.state is OnlineState.BRIDGED:
        return _ESTIMATED
    radius_m = INSIDE_PLANE * float(np.linalg.norm(estimate.sigma_position_m[:2])) / np.sqrt(2.0)
    for fix_class, quality in ((FixClass.RTK_FIX, _FIX), (FixClass.RTK_FLOAT, _FLOAT)):
        region = config.regions.get(fix_class)
        if region is not None and radius_m <= region.r_m:
            return quality
    return _SINGLE


def _time(estimate: OnlineEstimate, start_utc: datetime | None) -> str:
    if start_utc is None:
        return ""
    utc = start_utc + timedelta(seconds=round(estimate.t_s, 3))
    return f"{utc:%H%M%S}.{utc.microsecond // 1000:03}"


def _angle(angle_deg: float, digits: int) -> str:
    """Return degrees and minutes, ``dddmm.mmmmmmm``, 0.2 mm apart."""
    degrees, units = divmod(round(abs(angle_deg) * 60e7), int(60e7))
    return f"{degrees:0{digits}}{units / 1e7:010.7f}"


def _framed(body: str) -> bytes:
    """Return a sentence with its checksum."""
    return f"${body}*{calc_checksum(body)}\r\n".encode("ascii")
