"""A path in the world and fixes on it, for tests of what judges and bends."""

import numpy as np

from vgps.gps.fixes import Fixes
from vgps.solution import Trajectory

FRAMES = 200
T_S = 0.1 * np.arange(FRAMES)


def path(t_s):
    """Where the antenna was: half a sine, 5 m/s forward."""
    return np.stack([20 * np.sin(t_s / 5), 5 * t_s, 0.1 * t_s], axis=1)


def poses(centres):
    out = np.tile(np.eye(4), (len(centres), 1, 1))
    out[:, :3, 3] = centres
    return out


def trajectory(centres, t_s=T_S):
    """A camera that never turns, at these places (n, 3)."""
    return Trajectory(t_s, poses(centres))


def drifting(grows_by=0.4):
    """The path as a camera sees it that loses its scale."""
    steps = np.diff(path(T_S), axis=0) * (1 + np.linspace(0, grows_by, FRAMES - 1))[:, None]
    return trajectory(np.vstack([path(T_S)[:1], path(T_S)[0] + np.cumsum(steps, axis=0)]))


def fixes_of_size(t_s, world_p_fix, r_m, h_m, **columns):
    """Fixes with regions (n,) and nothing else known of them, but for the columns that are given."""
    n = len(t_s)
    none, ones = np.full(n, np.nan), np.ones((n, 2))
    others = {
        "lower_r_m": none,
        "lower_h_m": none,
        "shape": ones,
        "lower_shape": ones,
        "sigma_m": np.full((n, 3), np.nan),
        "correlation": np.zeros((n, 3)),
        "logging_sigma_m": np.zeros((n, 3)),
        "used": np.ones(n, dtype=bool),
        "correlation_s": none,
        "fix_class": np.zeros(n, dtype=np.int64),
    }
    return Fixes(t_s=t_s, world_p_fix=world_p_fix, r_m=r_m, h_m=h_m, **{**others, **columns})


def fixes_at(t_s, r_m, h_m, lower=(np.nan, np.nan), offset=0.0):
    """Fixes on the path, ``offset`` (n, 3) off it."""
    n = len(t_s)

    def column(value):
        return np.broadcast_to(np.asarray(value, dtype=float), n).copy()

    r_m, h_m, lower_r_m, lower_h_m = (column(value) for value in (r_m, h_m, *lower))
    known = {"lower_r_m": lower_r_m, "lower_h_m": lower_h_m, "correlation_s": np.full(n, 10.0)}
    return fixes_of_size(t_s, path(t_s) + offset, r_m, h_m, **known)
