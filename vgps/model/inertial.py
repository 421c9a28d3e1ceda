"""Logs of inertial sensors: angular rates and specific force."""

from dataclasses import dataclass
from pathlib import Path

from vgps.model.arrays import BoolArray, FloatArray


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
