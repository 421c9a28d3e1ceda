"""GPS receiver and gyro of a simulated recording: exact values plus known errors."""

from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from pynmeagps import GET, NMEAMessage
from scipy.spatial.transform import Rotation

from vgps.geodesy import to_geodetic
from vgps.model import BoolArray, FixClass, FloatArray, GeodeticPoint
from vgps.simulate.motion import Motion
from vgps.simulate.receiver_errors import replay
from vgps.simulate.scene import SceneConfig
from vgps.simulate.sensor_config import FixErrors, GpsConfig, GyroConfig

_GEOID_SEPARATION_M = 37.0
_QUALITY = {FixClass.SINGLE: 1, FixClass.DGPS: 2, FixClass.RTK_FIX: 4, FixClass.RTK_FLOAT: 5}


@dataclass(frozen=True, kw_only=True)
class SimulatedFixes:
    """Fixes and their errors, ENU metres.

    Attributes:
        t_s: (N,) seconds since the first frame, in whole hundredths as in NMEA.
        fix_class: (N,).
        world_p_antenna: (N, 3) true position of the antenna.
        error_m: (N, 3) measured minus true.
        reported_m: (N, 3) the receiver's own sigma east, north, up.
        outlier: (N,) whether a fix was displaced as an outlier.
    """

    t_s: FloatArray
    fix_class: tuple[FixClass, ...]
    world_p_antenna: FloatArray
    error_m: FloatArray
    reported_m: FloatArray
    outlier: BoolArray


def simulate_fixes(motion: Motion, config: SceneConfig, rng: np.random.Generator) -> SimulatedFixes:
    """Return the scene's fixes: antenna positions at the fixes' own times, plus errors per class."""
    gps = config.gps
    t = np.round(np.arange(gps.offset_s, config.duration_s, gps.interval_s), 2)
    share = t / max(config.duration_s, 1e-9)
    inner = (share >= gps.fix_share) & (share <= 1 - gps.fix_share)
    classes = tuple(gps.middle_class if middle else FixClass.RTK_FIX for middle in inner)
    pose = motion.poses(t)
    antenna = pose[:, :3, :3] @ np.array(config.camera_p_antenna) + pose[:, :3, 3]
    error, reported = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for begin, end in _stretches(classes):
        error[begin:end], reported[begin:end] = _stretch(classes[begin], t[begin:end], gps, rng)
    outlier = np.zeros(len(t), bool)
    outlier[rng.permutation(len(t))[: round(gps.outliers * len(t))]] = True
    direction, reach = rng.uniform(0, 2 * np.pi, len(t)), rng.uniform(*gps.outlier_m, len(t))
    jump = np.stack([np.cos(direction), np.sin(direction), rng.normal(0, 0.7, len(t))], axis=-1)
    error += outlier[:, None] * reach[:, None] * jump
    return SimulatedFixes(
        t_s=t, fix_class=classes, world_p_antenna=antenna, error_m=error, reported_m=reported, outlier=outlier
    )


def gauss_markov(count: int, interval_s: float, errors: FixErrors, rng: np.random.Generator) -> FloatArray:
    """Return (count, 3) of a stationary first-order Gauss-Markov process about a random bias, ENU metres."""
    sigma = np.array([errors.sigma_h_m, errors.sigma_h_m, errors.sigma_v_m])
    bias = np.array([errors.bias_h_m, errors.bias_h_m, errors.bias_v_m]) * rng.standard_normal(3)
    t_s = interval_s * np.arange(count, dtype=np.float64)
    return np.asarray(bias + sigma * unit_gauss_markov(t_s, errors.correlation_s, rng))


def unit_gauss_markov(t_s: FloatArray, correlation_s: float, rng: np.random.Generator) -> FloatArray:
    """Return (N, 3) of stationary first-order Gauss-Markov processes of unit variance at times (N,)."""
    state = rng.standard_normal((len(t_s), 3))
    kept = np.exp(-np.diff(t_s) / correlation_s)
    for k, share in enumerate(kept.tolist(), start=1):
        state[k] = share * state[k - 1] + np.sqrt(1 - share**2) * state[k]
    return state


def nmea(fixes: SimulatedFixes, config: SceneConfig) -> bytes:
    """Return GGA, GST and ZDA of every fix."""
    places = to_geodetic(config.world_origin, fixes.world_p_antenna + fixes.error_m)
    sentences = []
    for t, fix_class, place, reported in zip(
        fixes.t_s, fixes.fix_class, places, fixes.reported_m, strict=True
    ):
        utc = config.start_utc + timedelta(seconds=float(t))
        errors = config.gps.errors[fix_class]
        sentences += [_gga(utc, GeodeticPoint(*place), fix_class, errors), _gst(utc, reported), _zda(utc)]
    return b"".join(sentence.serialize() for sentence in sentences)


class SimulatedGyro(NamedTuple):
    """Times (N,), rates (N, 3) and their bias (N, 3) in the gyro's axes, rad/s."""

    t_s: FloatArray
    rate_rad_s: FloatArray
    bias_rad_s: FloatArray


def simulate_gyro(motion: Motion, config: SceneConfig, rng: np.random.Generator) -> SimulatedGyro:
    """Return samples with a walking bias and white noise."""
    gyro = config.gyro
    t = (
        -gyro.margin_s
        + np.arange(round((config.duration_s + 2 * gyro.margin_s) * gyro.rate_hz) + 1) / gyro.rate_hz
    )
    steps = gyro.bias_walk_rad_s_sqrt_s / np.sqrt(gyro.rate_hz) * rng.standard_normal((len(t), 3))
    bias = gyro.bias_rad_s * rng.standard_normal(3) + np.cumsum(steps, axis=0)
    white = gyro.noise_rad_s * rng.standard_normal((len(t), 3))
    return SimulatedGyro(t, motion.rates(t) @ gyro_R_camera(gyro).T + bias + white, bias)


def gyro_R_camera(gyro: GyroConfig) -> FloatArray:
    """Return the (3, 3) rotation from camera axes to the gyro's."""
    return Rotation.from_euler("xyz", gyro.mount_deg, degrees=True).as_matrix()


def _stretch(
    fix_class: FixClass, t_s: FloatArray, gps: GpsConfig, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return errors (N, 3) and the receiver's sigmas (N, 3) of an unbroken stretch of one class."""
    model = gps.errors[fix_class]
    claimed = np.tile(model.reported_m, (len(t_s), 1))
    if gps.replay is None or fix_class not in gps.replay.fix_class:
        return gauss_markov(len(t_s), gps.interval_s, model, rng), claimed
    error, sigma = replay(gps.replay.of_class(fix_class), t_s, rng)
    return error, np.where(np.isfinite(sigma), sigma, claimed)


def _stretches(classes: tuple[FixClass, ...]) -> list[tuple[int, int]]:
    changes = [k for k in range(1, len(classes)) if classes[k] != classes[k - 1]]
    edges = [0, *changes, len(classes)]
    return list(pairwise(edges))


def _gga(utc: datetime, place: GeodeticPoint, fix_class: FixClass, errors: FixErrors) -> NMEAMessage:
    return NMEAMessage(
        "GN",
        "GGA",
        GET,
        hpnmeamode=True,
        time=utc.time(),
        lat=place.latitude_deg,
        NS="N" if place.latitude_deg >= 0 else "S",
        lon=place.longitude_deg,
        EW="E" if place.longitude_deg >= 0 else "W",
        quality=_QUALITY[fix_class],
        numSV=errors.satellites,
        HDOP=errors.hdop,
        alt=round(place.height_m - _GEOID_SEPARATION_M, 4),
        altUnit="M",
        sep=_GEOID_SEPARATION_M,
        sepUnit="M",
        diffAge=1.0,
        diffStation="0000",
    )


def _gst(utc: datetime, reported_m: FloatArray) -> NMEAMessage:
    east, north, up = (float(sigma) for sigma in reported_m)
    return NMEAMessage(
        *("GN", "GST", GET),
        time=utc.time(),
        rangeRms="",
        stdMajor="",
        stdMinor="",
        orient="",
        stdLat=north,
        stdLong=east,
        stdAlt=up,
    )


def _zda(utc: datetime) -> NMEAMessage:
    return NMEAMessage(
        "GN",
        "ZDA",
        GET,
        time=utc.time(),
        day=f"{utc.day:02d}",
        month=f"{utc.month:02d}",
        year=utc.year,
        ltzh="00",
        ltzn="00",
    )
