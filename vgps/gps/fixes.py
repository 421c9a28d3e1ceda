"""GPS fixes in the world frame, with the regions of their classes."""

from dataclasses import dataclass, fields, replace

import numpy as np

from vgps.config import GpsConfig
from vgps.gps.regions import ellipsoid_shapes, enlarged, lower_class, region_sizes
from vgps.gps.sensors import Sensors
from vgps.model import BoolArray, FixClass, FloatArray, GpsLog, IntArray
from vgps.solution import GpsClock

CLASSES = tuple(FixClass)
"""Fix classes in the order of their indices."""
_RTK = [CLASSES.index(FixClass.RTK_FIX), CLASSES.index(FixClass.RTK_FLOAT)]


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


def independent_epochs(fixes: Fixes) -> FloatArray:
    """Return the number of independent errors (M,), at most 1, that each fix adds to the one before."""
    interval_s = np.diff(fixes.t_s, prepend=-np.inf)
    return np.asarray(np.minimum(interval_s / fixes.correlation_s, 1.0))


def seconds_after(fixes: Fixes) -> FloatArray:
    """Return the time (M,) from the fix before to each, at most a second, as for the first."""
    return np.asarray(np.clip(np.diff(fixes.t_s, prepend=-np.inf), 0.0, 1.0))


def one_per_interval(t_s: FloatArray, interval_s: float, first_at: float = 1e-3) -> IntArray:
    """Return the rows of the fixes that are the first of their interval.

    Args:
        t_s: (M,) times of the fixes.
        interval_s: Length of the intervals.
        first_at: Where in its interval the first fix is, as a share: by default where it begins, rounded.
    """
    interval = np.floor((t_s - t_s[:1]) / interval_s + first_at)
    return np.flatnonzero(np.diff(interval, prepend=-1.0))
