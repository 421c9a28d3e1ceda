"""GPS fixes in the world: position, time between frames, and the penalty on the antenna's offset."""

from dataclasses import dataclass, fields, replace

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import Cylinder, Ellipsoid, Gaussian, Penalty, gps_factor_calibrating, gps_factor_interpolated
from vgps.config import GpsConfig
from vgps.gps.regions import ellipsoid_shapes, enlarged, lower_class, region_sizes
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors
from vgps.model import BoolArray, FloatArray, GpsLog, IntArray

_CAUCHY_K = 2.385  # 95 % efficiency on Gaussian errors


@dataclass(frozen=True, kw_only=True)
class Fixes:
    """Fixes in the world frame, a row each, in order of time.

    Attributes:
        t_s: (M,) on the video's clock.
        world_p_fix: (M, 3) ENU metres.
        r_m, h_m: (M,) the region of each fix's class; NaN where the class has none.
        lower_r_m, lower_h_m: (M,) the region of the class that a fix of its class may really be; NaN if none.
        shape, lower_shape: (M, 2) semi-axes of the ellipsoid (22) over r and h, of either class.
        sigma_m: (M, 3) the receiver's own standard deviations, NaN where it gave none.
        used: (M,) whether a fix takes part.
        correlation_s: (M,) after this time the error of a fix of its class counts as a new one.
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
    used: BoolArray
    correlation_s: FloatArray

    def __len__(self) -> int:
        return len(self.t_s)

    def until(self, t_s: float) -> "Fixes":
        """Return those taken by the time ``t_s``."""
        return self.where(self.t_s <= t_s)

    def earlier(self, time_offset_s: float) -> "Fixes":
        """Return the same fixes in time: at their time stamps less a time offset."""
        return replace(self, t_s=self.t_s - time_offset_s)

    def where(self, mask: BoolArray) -> "Fixes":
        """Return those of ``mask`` (M,)."""
        return Fixes(**{column.name: getattr(self, column.name)[mask] for column in fields(self)})

    def merged(self, more: "Fixes") -> tuple["Fixes", IntArray]:
        """Return these with more fixes in order of time, and the row (M + N,) of each in both together."""
        order = np.argsort(np.concatenate([self.t_s, more.t_s]), kind="stable")
        columns = {
            column.name: np.concatenate([getattr(self, column.name), getattr(more, column.name)])[order]
            for column in fields(self)
        }
        return Fixes(**columns), order

    @classmethod
    def none(cls) -> "Fixes":
        """Return no fix at all."""
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
            used=np.zeros(0, dtype=bool),
            correlation_s=n,
        )


def fixes_in_world(log: GpsLog, world_p_fix: FloatArray, config: GpsConfig) -> Fixes:
    """Return the fixes of a log with their regions; those of a class without one are not used.

    Args:
        log: As read.
        world_p_fix: (M, 3) its positions, ENU metres.
        config: Regions.
    """
    r_m, h_m = enlarged(*region_sizes(log.fix_class, config), log, config.quality)
    lower = tuple(lower_class(name) for name in log.fix_class)
    lower_r_m, lower_h_m = enlarged(*region_sizes(lower, config), log, config.quality)
    alike = [
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
        used=np.isfinite(r_m),
        correlation_s=np.array(alike),
    )


@dataclass(frozen=True)
class Placement:
    """Between which frames each fix lies.

    Attributes:
        frame: (M,) the frame before it.
        alpha: (M,) share of the interval to the next frame, in [0, 1].
        inside: (M,) whether it lies within the video at all.
    """

    frame: IntArray
    alpha: FloatArray
    inside: BoolArray


def place(frame_t_s: FloatArray, fix_t_s: FloatArray, beyond: bool = False) -> Placement:
    """Return between which frames fixes lie by their time.

    Args:
        frame_t_s: (F,) strictly increasing, F >= 2.
        fix_t_s: (M,).
        beyond: Let alpha leave [0, 1] for fixes outside the video, instead of clipping it.
    """
    frame = np.clip(np.searchsorted(frame_t_s, fix_t_s, side="right") - 1, 0, len(frame_t_s) - 2)
    alpha = (fix_t_s - frame_t_s[frame]) / (frame_t_s[frame + 1] - frame_t_s[frame])
    inside = (alpha >= 0.0) & (alpha <= 1.0)
    return Placement(frame, alpha if beyond else np.clip(alpha, 0.0, 1.0), inside)


def antenna_at(poses: FloatArray, placement: Placement, camera_p_antenna: FloatArray) -> FloatArray:
    """Return the antenna (M, 3) in the world at the fixes' times, straight between the frames' antennas.

    Over one frame interval this differs from interpolation on SE(3) by the sagitta of the arc alone.

    Args:
        poses: (F, 4, 4) world_T_camera.
        placement: Of the fixes in these frames.
        camera_p_antenna: (3,) metres.
    """
    antenna = poses[:, :3, :3] @ camera_p_antenna + poses[:, :3, 3]
    alpha = placement.alpha[:, None]
    return np.asarray((1.0 - alpha) * antenna[placement.frame] + alpha * antenna[placement.frame + 1])


def penalty(fixes: Fixes, row: int, config: GpsConfig, n: int | None = None) -> Penalty:
    """Return the penalty on an offset from fix ``row`` under the configured model.

    Args:
        fixes: All fixes.
        row: Which.
        config: Names the model: (14), (15), (16), (22) of Kume 2010 or Cauchy on (15).
        n: Exponent, if another than the configured.
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
    # a receiver that gives no sigmas is taken at half its class's region
    sigma = np.where(np.isfinite(fixes.sigma_m[row]), fixes.sigma_m[row], np.array([r_m, r_m, h_m]) / 2.0)
    sigma = np.maximum(sigma, config.min_sigma_m)
    k = _CAUCHY_K if config.model == "cauchy" else None
    return Gaussian((float(sigma[0]), float(sigma[1]), float(sigma[2])), k)


def taking_part(fixes: Fixes, frame_t_s: FloatArray, config: GpsConfig) -> BoolArray:
    """Return which fixes (M,) are used and within the frames, if the model takes any."""
    if config.model == "none" or len(frame_t_s) < 2:
        return np.zeros(len(fixes), dtype=bool)
    return np.asarray(fixes.used & place(frame_t_s, fixes.t_s).inside)


def gps_graph(
    fixes: Fixes,
    frame_t_s: FloatArray,
    sensors: Sensors,
    config: GpsConfig,
    n: int | None = None,
) -> gtsam.NonlinearFactorGraph:
    """Return the GPS term of the energy (11) over frames with keys ``x0..``, a factor per fix that takes
    part.

    Args:
        fixes: In time, as far as the time offset is known; those of :func:`taking_part` count.
        frame_t_s: (F,) times of the frames.
        sensors: Lever arm, and what is to be estimated with the poses.
        config: The model; none gives an empty graph.
        n: Exponent, if another than the configured.
    """
    graph = gtsam.NonlinearFactorGraph()
    taking = taking_part(fixes, frame_t_s, config)
    if not taking.any():
        return graph
    placement = place(frame_t_s, fixes.t_s)
    for row in np.flatnonzero(taking).tolist():
        a, b = int(placement.frame[row]), int(placement.frame[row]) + 1
        fix, cost = fixes.world_p_fix[row], penalty(fixes, row, config, n)
        if sensors.to_estimate:
            times = float(frame_t_s[a]), float(frame_t_s[b]), float(fixes.t_s[row])
            factor = gps_factor_calibrating((X(a), X(b)), (TIME_OFFSET, ANTENNA), times, fix, cost)
        else:
            alpha = float(placement.alpha[row])
            factor = gps_factor_interpolated((X(a), X(b)), alpha, fix, sensors.camera_p_antenna, cost)
        graph.push_back(factor)
    return graph
