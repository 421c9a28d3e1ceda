"""GPS fixes in the world: interpolation of the antenna at their times, and factors with a penalty on it."""

from dataclasses import dataclass, fields, replace

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import Cylinder, Ellipsoid, Gaussian, Penalty, gps_factor_calibrating, gps_factor_interpolated
from vgps.config import GpsConfig
from vgps.gps.regions import ellipsoid_shapes, enlarged, lower_class, region_sizes
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors
from vgps.model import BoolArray, FixClass, FloatArray, GpsLog, IntArray
from vgps.solution import GpsClock, Trajectory

CLASSES = tuple(FixClass)
"""Fix classes in the order of their indices."""
_RTK = [CLASSES.index(FixClass.RTK_FIX), CLASSES.index(FixClass.RTK_FLOAT)]
_CAUCHY_K = 2.385  # 95 % efficiency on Gaussian errors
_MEAN_S, _MEAN_OF = 0.5, 8  # duration of the means beside a fix, and how many places they are of


@dataclass(frozen=True, kw_only=True)
class Fixes:
    """Fixes in the world frame, a row each, in order of time.

    Attributes:
        t_s: (M,) on the video's clock.
        world_p_fix: (M, 3) ENU metres.
        r_m, h_m: (M,) the region of each fix's class; NaN where the class has none.
        lower_r_m, lower_h_m: (M,) the region of the class below, see :func:`lower_class`; NaN if there is
            none.
        shape, lower_shape: (M, 2) semi-axes of the ellipsoid (22) over r and h, of either class.
        sigma_m: (M, 3) standard deviations reported by the receiver; NaN where it reports none.
        correlation: (M, 3) correlations of east and north, east and up, north and up, which go with them.
        logging_sigma_m: (M, 3) standard deviations of what logging added to the errors.
        used: (M,) whether a fix contributes.
        correlation_s: (M,) time after which the error of a fix of this class counts as independent.
        fix_class: (M,) class, as an index of :data:`CLASSES`.
    """

    t_s: FloatArray
    world_p_fix: FloatArray
    r_m: FloatArray
    h_m: FloatArray
    lower_r_m: FloatArray
    lower_h_m: FloatArray
    shape: FloatArray
    lower_shape: FloatArray
    sigma_m: FloatArray
    correlation: FloatArray
    logging_sigma_m: FloatArray
    used: BoolArray
    correlation_s: FloatArray
    fix_class: IntArray

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def are_rtk(self) -> bool:
        """Whether their receiver solves for carrier phases, which takes an antenna of its own."""
        return bool(np.isin(self.fix_class, _RTK).any())

    @property
    def down_classed(self) -> BoolArray:
        """(M,) whether each has the class below the receiver's, which only RTK-fixes have."""
        return np.asarray(np.isfinite(self.lower_r_m) & (self.fix_class != CLASSES.index(FixClass.RTK_FIX)))

    def until(self, t_s: float) -> "Fixes":
        """Return the fixes until a time."""
        return self.where(self.t_s <= t_s)

    def on_video_clock(self, sensors: Sensors) -> "Fixes":
        """Return the fixes, at the times of their time stamps, at the times of their positions."""
        return replace(self, t_s=sensors.clock.on_video(self.t_s))

    def without_clock_rate(self, sensors: Sensors) -> "Fixes":
        """Return the fixes with the rate of their clock removed from their time stamps."""
        return replace(self, t_s=GpsClock(0.0, sensors.clock_rate).on_video(self.t_s))

    def without_time_offset(self, time_offset_s: float) -> "Fixes":
        """Return the fixes with a time offset removed from their times."""
        return replace(self, t_s=self.t_s - time_offset_s)

    def where(self, rows: BoolArray | IntArray) -> "Fixes":
        """Return the fixes of a mask (M,), or of some rows in their order."""
        return Fixes(**{column.name: getattr(self, column.name)[rows] for column in fields(self)})

    def merged(self, more: "Fixes") -> tuple["Fixes", IntArray]:
        """Return both sets of fixes in chronological order, and the permutation (M + N,) that sorts them."""
        order = np.argsort(np.concatenate([self.t_s, more.t_s]), kind="stable")
        columns = {
            column.name: np.concatenate([getattr(self, column.name), getattr(more, column.name)])[order]
            for column in fields(self)
        }
        return Fixes(**columns), order

    @classmethod
    def empty(cls) -> "Fixes":
        """Return an empty table."""
        n, points, shape = np.zeros(0), np.zeros((0, 3)), np.zeros((0, 2))
        return cls(
            t_s=n,
            world_p_fix=points,
            r_m=n,
            h_m=n,
            lower_r_m=n,
            lower_h_m=n,
            shape=shape,
            lower_shape=shape,
            sigma_m=points,
            correlation=points,
            logging_sigma_m=points,
            used=np.zeros(0, dtype=bool),
            correlation_s=n,
            fix_class=np.zeros(0, dtype=np.int64),
        )


def fixes_in_world(log: GpsLog, world_p_fix: FloatArray, config: GpsConfig) -> Fixes:
    """Return the fixes of a log with their regions; those of a class without one are not used.

    Args:
        log: The log.
        world_p_fix: (M, 3) its positions, ENU metres.
        config: Regions of the classes.
    """
    r_m, h_m = enlarged(*region_sizes(log.fix_class, config), log, config.quality)
    lower = tuple(lower_class(name) for name in log.fix_class)
    lower_r_m, lower_h_m = enlarged(*region_sizes(lower, config), log, config.quality)
    correlation_s = [
        config.regions[name].correlation_s if name in config.regions else np.nan for name in log.fix_class
    ]
    return Fixes(
        t_s=log.t_s,
        world_p_fix=world_p_fix,
        r_m=r_m,
        h_m=h_m,
        lower_r_m=lower_r_m,
        lower_h_m=lower_h_m,
        shape=ellipsoid_shapes(log.fix_class, config),
        lower_shape=ellipsoid_shapes(lower, config),
        sigma_m=log.sigma_m,
        correlation=np.zeros((len(log), 3)) if log.correlation is None else log.correlation,
        logging_sigma_m=log.logging_sigma,
        used=np.isfinite(r_m),
        correlation_s=np.array(correlation_s),
        fix_class=np.array([CLASSES.index(name) for name in log.fix_class], dtype=np.int64),
    )


@dataclass(frozen=True)
class Placement:
    """Times of fixes relative to the frames around them.

    Attributes:
        frame: (M,) frame before each fix.
        alpha: (M,) fraction of the interval to the next frame, in [0, 1].
        inside: (M,) whether the fix is within the video.
    """

    frame: IntArray
    alpha: FloatArray
    inside: BoolArray


def place(frame_t_s: FloatArray, fix_t_s: FloatArray, beyond: bool = False) -> Placement:
    """Return the frames around each fix and the fraction of the interval between them.

    Args:
        frame_t_s: (F,) strictly increasing, F >= 2.
        fix_t_s: (M,) times of the fixes.
        beyond: Whether alpha extrapolates, leaving [0, 1], for fixes outside the video; else it is clipped.
    """
    frame = np.clip(np.searchsorted(frame_t_s, fix_t_s, side="right") - 1, 0, len(frame_t_s) - 2)
    alpha = (fix_t_s - frame_t_s[frame]) / (frame_t_s[frame + 1] - frame_t_s[frame])
    inside = (alpha >= 0.0) & (alpha <= 1.0)
    return Placement(frame, alpha if beyond else np.clip(alpha, 0.0, 1.0), inside)


def antenna_at(poses: FloatArray, placement: Placement, camera_p_antenna: FloatArray) -> FloatArray:
    """Return the antenna (M, 3) in the world at the fixes' times by linear interpolation between frames.

    Over one frame interval it differs from interpolation on SE(3) only by the sagitta of the arc.

    Args:
        poses: (F, 4, 4) world_T_camera.
        placement: Times of the fixes relative to these frames.
        camera_p_antenna: (3,) metres.
    """
    antenna = poses[:, :3, :3] @ camera_p_antenna + poses[:, :3, 3]
    alpha = placement.alpha[:, None]
    return np.asarray((1.0 - alpha) * antenna[placement.frame] + alpha * antenna[placement.frame + 1])


def antenna_offsets(fixes: Fixes, path: Trajectory, camera_p_antenna: FloatArray) -> FloatArray:
    """Return antenna minus fix (M, 3); where a fix is before or after the path, at its end."""
    return antenna_at(path.world_T_camera, place(path.t_s, fixes.t_s), camera_p_antenna) - fixes.world_p_fix


def antenna_velocities(path: Trajectory, t_s: FloatArray, camera_p_antenna: FloatArray) -> FloatArray:
    """Return the velocity of the antenna (M, 3) by its mean places in half a second before and after, m/s.

    From frame to frame the noise of the poses is as large as changes of speed. Taken for velocity, it makes
    accurate fixes contradict every other time offset, so that many of them seem to know it too well. A mean
    velocity over a second has little of it, too, but the bob of a walk, two steps a second, reversed.

    Args:
        path: The frames.
        t_s: (M,) times.
        camera_p_antenna: (3,) metres.
    """
    begin_s, end_s = path.t_s[[0, -1]]
    away_s = _MEAN_S * (np.arange(_MEAN_OF) + 0.5) / _MEAN_OF
    within_s = np.clip(t_s, begin_s, end_s)
    at_s = np.clip(np.add.outer([-away_s, away_s], within_s), begin_s, end_s)  # (2, n, M)
    places = antenna_at(path.world_T_camera, place(path.t_s, at_s.ravel()), camera_p_antenna)
    moved = np.diff(places.reshape(*at_s.shape, 3).mean(axis=1), axis=0)[0]
    return np.asarray(moved / np.diff(at_s.mean(axis=1), axis=0).T)


def penalty(fixes: Fixes, row: int, config: GpsConfig, n: int | None = None) -> Penalty:
    """Return the penalty on an offset from fix ``row`` under the configured model.

    Args:
        fixes: All fixes.
        row: Row of the fix.
        config: Selects the model: (14), (15), (16), (22) of Kume 2010 or Cauchy on (15).
        n: Exponent, if not the configured one.
    """
    r_m, h_m = float(fixes.r_m[row]), float(fixes.h_m[row])
    exponent = n or config.n
    if config.model == "cylinder":
        return Cylinder(r_m, h_m, exponent, config.omega)
    if config.model == "ellipsoid":
        alpha, beta = fixes.shape[row].tolist()
        return Ellipsoid(alpha * r_m, beta * h_m, exponent, config.omega)
    if config.model == "gaussian":
        return Gaussian((config.gaussian_sigma_m,) * 3)
    # without the receiver's sigmas, half the region of the class
    stated = np.isfinite(fixes.sigma_m[row])
    sigma = np.where(stated, fixes.sigma_m[row], np.array([r_m, r_m, h_m]) / 2.0)
    sigma = np.maximum(sigma, config.min_sigma_m)
    en, eu, nu = fixes.correlation[row].tolist() if stated.all() else (0.0, 0.0, 0.0)
    k = _CAUCHY_K if config.model == "cauchy" else None
    return Gaussian((float(sigma[0]), float(sigma[1]), float(sigma[2])), k, (en, eu, nu))


def contributing_fixes(fixes: Fixes, frame_t_s: FloatArray, config: GpsConfig) -> BoolArray:
    """Return which fixes (M,) get a factor: used ones within the frames, none for the model ``none``."""
    if config.model == "none" or len(frame_t_s) < 2:
        return np.zeros(len(fixes), dtype=bool)
    return np.asarray(fixes.used & place(frame_t_s, fixes.t_s).inside)


def independent_epochs(fixes: Fixes) -> FloatArray:
    """Return the number of independent errors (M,), at most 1, that each fix adds to the one before."""
    interval_s = np.diff(fixes.t_s, prepend=-np.inf)
    return np.asarray(np.minimum(interval_s / fixes.correlation_s, 1.0))


def seconds_after(fixes: Fixes) -> FloatArray:
    """Return the time (M,) from the fix before to each, at most a second, as for the first."""
    return np.asarray(np.clip(np.diff(fixes.t_s, prepend=-np.inf), 0.0, 1.0))


def gps_graph(
    fixes: Fixes,
    frame_t_s: FloatArray,
    sensors: Sensors,
    config: GpsConfig,
    n: int | None = None,
    antenna_velocity: FloatArray | None = None,
) -> gtsam.NonlinearFactorGraph:
    """Return the GPS term of the energy (11) over frames with keys ``x0..``, one factor per contributing fix.

    Args:
        fixes: Fixes with the time offset removed; :func:`contributing_fixes` selects among them.
        frame_t_s: (F,) times of the frames.
        sensors: Lever arm, and whether it and the time offset are estimated with the poses.
        config: GPS model; ``none`` gives an empty graph.
        n: Exponent, if not the configured one.
        antenna_velocity: (M, 3) m/s at the fixes; needed if time offset or lever arm are estimated.
    """
    graph = gtsam.NonlinearFactorGraph()
    contributing = contributing_fixes(fixes, frame_t_s, config)
    if not contributing.any():
        return graph
    placement = place(frame_t_s, fixes.t_s)
    for row in np.flatnonzero(contributing).tolist():
        a, b = int(placement.frame[row]), int(placement.frame[row]) + 1
        alpha, fix, cost = float(placement.alpha[row]), fixes.world_p_fix[row], penalty(fixes, row, config, n)
        if sensors.is_estimated:
            assert antenna_velocity is not None
            keys = (X(a), X(b)), (TIME_OFFSET, ANTENNA)
            factor = gps_factor_calibrating(*keys, alpha, fix, antenna_velocity[row], cost)
        else:
            factor = gps_factor_interpolated((X(a), X(b)), alpha, fix, sensors.camera_p_antenna, cost)
        graph.push_back(factor)
    return graph
