"""Control and check points: marks of known position."""

from dataclasses import dataclass
from pathlib import Path

from vgps.model.arrays import BoolArray, FloatArray, IntArray


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
