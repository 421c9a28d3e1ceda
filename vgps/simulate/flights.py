"""Paths of cameras that do not look where they go from the start: a drone's, and one around a building."""

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.interpolate import PchipInterpolator

from vgps.model import FloatArray
from vgps.simulate.camera_path import CameraPath

_RATE_HZ = 10.0
_DURATION_S = 30.0


def drone_path() -> CameraPath:
    """Return a flight that rises by 8 m, then leaves at 4 m/s with turns, looking down by 30 degrees."""
    t_s = _times()
    speed = _through([(0, 0.0), (4, 0.0), (8, 4.0), (26, 4.0), (30, 2.0)], t_s)
    turning = _through([(0, 0.0), (8, 0.0), (11, 8.0), (14, 0.0), (18, 0.0), (22, -12.0), (26, 0.0)], t_s)
    yaw = _integral(np.radians(turning))
    east, north = _integral(speed * np.cos(yaw)), _integral(speed * np.sin(yaw))
    up = _through([(0, 0.0), (1, 0.0), (6, 8.0), (15, 9.0), (22, 7.0), (30, 7.0)], t_s)
    pitch = np.radians(-30.0 + 1.5 * np.sin(2 * np.pi * t_s / 3.7))
    roll = np.radians(1.5 * np.sin(2 * np.pi * t_s / 2.9))
    line = np.column_stack([east, north, yaw])
    return CameraPath(_RATE_HZ, line, np.column_stack([up, pitch, roll]), line)


def orbit_path() -> CameraPath:
    """Return nearly half a circle of 15 m radius around a building, walked at 1.5 m/s, looking inwards."""
    radius_m, t_s = 15.0, _times()
    heading = 1.5 * t_s / radius_m
    circle = radius_m * np.column_stack([np.sin(heading), 1.0 - np.cos(heading)])
    yaw = heading + np.radians(90.0 + 4.0 * np.sin(2 * np.pi * t_s / 7.0))
    up = 0.025 * np.sin(2 * np.pi * 1.8 * t_s)
    pitch = np.radians(3.0 + 2.0 * np.sin(2 * np.pi * t_s / 5.0))
    roll = np.radians(1.5 * np.sin(2 * np.pi * t_s / 3.1))
    own_motion = np.column_stack([up, pitch, roll])
    return CameraPath(
        _RATE_HZ, np.column_stack([circle, yaw]), own_motion, np.column_stack([circle, heading])
    )


def _times() -> FloatArray:
    return np.arange(0.0, _DURATION_S, 1.0 / _RATE_HZ)


def _through(knots: list[tuple[int, float]], t_s: FloatArray) -> FloatArray:
    """Return a smooth function through knots (time [s], value), without overshooting them."""
    times, values = np.array(knots).T
    return np.asarray(PchipInterpolator(times, values)(np.minimum(t_s, times[-1])))


def _integral(rate: FloatArray) -> FloatArray:
    return np.asarray(cumulative_simpson(rate, dx=1.0 / _RATE_HZ, initial=0))
