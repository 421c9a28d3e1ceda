"""Errors with memory: a fix is antenna + offset + noise, and the offset is a variable of the graph.

A receiver's solution lies off the truth by an offset that lasts: from one fix to the next it walks, mostly by
centimetres and sometimes by a jump (Student's t), and it starts anew when the class changes, after a gap, or
where the receiver's own sigma jumps. The region of the class bounds the offset, as it bounds the fix in
Eq. (16), Kume 2010; so the shape of the path profits from fixes whose place is biased.
"""

from dataclasses import dataclass, field

import gtsam
import numpy as np

from factors import Gaussian, gps_factor_calibrating, gps_factor_interpolated, offset_factor
from vgps.config import GpsConfig
from vgps.gps.antenna_path import antenna_offsets, place
from vgps.gps.fix_factors import contributing_fixes, gps_graph, penalty
from vgps.gps.fixes import Fixes, independent_epochs
from vgps.gps.offset_errors import averaged_over_receivers, errors_of, step_scale, student, walk_scale
from vgps.gps.offset_regions import offset_bounds, with_mean_offset_regions, with_offset_regions
from vgps.gps.offset_start import smoothed_offsets
from vgps.gps.sensors import ANTENNA, TIME_OFFSET, Sensors
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Trajectory


@dataclass(frozen=True, kw_only=True)
class GpsTerm:
    """The GPS term of the energy (11) over frames with keys ``x0..``.

    Attributes:
        bounds: Penalties by the regions of the classes, one per fix or per offset.
        bounded: (B,) the fix of each bound, the first of an offset's fixes, with the region of its errors; of
            offsets averaged over receivers.
        weight: (B,) number of independent errors, at most 1, that each bound counts as.
        noise: Factors of the noise about the offsets and of their walk.
        noise_ratio: (N,) errors of these over the sigmas of their losses, see
            :func:`averaged_over_receivers`.
        offsets: (K, 3) initial values of the offsets, metres, with keys ``o0..``.
        offset_frames: (K,) frame before the first fix of each offset.
    """

    bounds: gtsam.NonlinearFactorGraph
    bounded: Fixes
    weight: FloatArray
    noise: gtsam.NonlinearFactorGraph = field(default_factory=gtsam.NonlinearFactorGraph)
    noise_ratio: FloatArray = field(default_factory=lambda: np.zeros(0))
    offsets: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    offset_frames: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))


@dataclass(frozen=True, kw_only=True)
class OffsetChain:
    """Which fixes share an offset, in order of time.

    Attributes:
        rows: (M,) fixes that contribute.
        offset: (M,) number of the offset of each.
        first: (K,) the first of ``rows`` of each offset.
        starts: (K,) whether the offset starts anew instead of walking from the one before.
    """

    rows: IntArray
    offset: IntArray
    first: IntArray
    starts: BoolArray


def gps_term(
    fixes: Fixes,
    path: Trajectory,
    sensors: Sensors,
    config: GpsConfig,
    n: int | None = None,
    loose: bool = False,
    antenna_velocity: FloatArray | None = None,
) -> GpsTerm:
    """Return the GPS term for a path, with offsets if the error model has memory.

    Args:
        fixes: Fixes with the time offset removed.
        path: The frames; their poses give the initial values of the offsets.
        sensors: Lever arm, and whether it and the time offset are estimated with the poses.
        config: GPS model and error model.
        n: Exponent, if not the configured one.
        loose: Whether an offset at the wall of its region costs no more than a one-sigma residual, without
            heavy tails.
        antenna_velocity: (M, 3) m/s at the fixes; needed if time offset or lever arm are estimated.
    """
    contributing = contributing_fixes(fixes, path.t_s, config)
    if not config.has_memory or not contributing.any():
        bounded = fixes.where(contributing)
        weight = independent_epochs(bounded)
        bounds = gps_graph(fixes, path.t_s, sensors, config, n, antenna_velocity)
        return GpsTerm(bounds=bounds, bounded=bounded, weight=weight)
    chain = chain_offsets(fixes, contributing, config)
    rows = chain.rows[chain.first]
    first = fixes.where(rows)
    exponent = n or config.exponent
    if loose:
        bounded, tail = with_offset_regions(first, config), np.full(len(rows), np.inf)
    else:
        bounded, tail = offset_bounds(first, config, exponent)
    weight = _weights(first, chain.starts)
    bounds = gtsam.NonlinearFactorGraph()
    for k in range(len(rows)):
        bound = penalty(bounded, k, config, exponent)
        bounds.push_back(offset_factor(offset_key(k), bound, float(weight[k]), float(tail[k])))
    noise_losses, walk_losses = _noise_losses(fixes, chain, config), _walk_losses(fixes, chain, config)
    noise = _noise_factors(fixes, chain, path.t_s, sensors, noise_losses, antenna_velocity)
    noise.push_back(_walk_factors(walk_losses))
    error = _errors(fixes, chain, path, sensors)
    return GpsTerm(
        bounds=bounds,
        bounded=with_mean_offset_regions(first, config),
        weight=weight,
        noise=noise,
        noise_ratio=_noise_ratio(fixes, chain, config),
        offsets=smoothed_offsets(error, chain.offset, noise_losses, walk_losses),
        offset_frames=place(path.t_s, first.t_s).frame,
    )


def chain_offsets(fixes: Fixes, contributing: BoolArray, config: GpsConfig) -> OffsetChain:
    """Divide fixes into stretches of one solution, and stretches into intervals with an offset each.

    Args:
        fixes: In order of time.
        contributing: (M,) which of them contribute; at least one.
        config: When an offset starts anew, and the length of the intervals.
    """
    memory, rows = config.memory, np.flatnonzero(contributing)
    t_s, stated = fixes.t_s[rows], np.log(np.linalg.norm(fixes.sigma_m[rows], axis=1))
    change = np.diff(fixes.fix_class[rows]) != 0
    change |= np.diff(t_s) > memory.max_gap_s
    with np.errstate(invalid="ignore"):  # NaN without stated sigmas
        change |= np.abs(np.diff(stated)) > np.log(memory.stated_jump)
    anew = np.append(True, change)
    since = t_s - t_s[anew][np.cumsum(anew) - 1]
    interval = np.floor(since / memory.interval_s + 1e-6)
    begins = anew | (np.diff(interval, prepend=-1.0) != 0)
    return OffsetChain(
        rows=rows, offset=np.cumsum(begins) - 1, first=np.flatnonzero(begins), starts=anew[begins]
    )


def offset_key(offset: int) -> int:
    """Return the key of an offset by its number."""
    return int(gtsam.symbol("o", offset))


def _weights(first: Fixes, starts: BoolArray) -> FloatArray:
    """Return the weight (K,) of each offset's bound: a stretch counts once per correlation time."""
    stretch = np.cumsum(starts) - 1
    offsets = np.bincount(stretch)
    begin, end = np.flatnonzero(starts), np.append(np.flatnonzero(starts)[1:], len(starts)) - 1
    duration_s = first.t_s[end] - first.t_s[begin]
    return np.asarray((np.maximum(duration_s / first.correlation_s[begin], 1.0) / offsets)[stretch])


def _noise_ratio(fixes: Fixes, chain: OffsetChain, config: GpsConfig) -> FloatArray:
    """Return the errors of noise and steps (N,) over the sigmas of their losses, in the factors' order.

    A loss bounds what the tails of its own distribution do; a worse receiver is not in it, unless the log
    showed what its receiver does.
    """
    rows = fixes.where(chain.rows)
    errors = errors_of(rows, config)
    means = [averaged_over_receivers(one) for one in errors]
    own = np.array([one.noise_m for one in errors])
    mean = np.array([one.noise_m for one in means])
    added_m = np.linalg.norm(rows.logging_sigma_m[:, :2], axis=1) / np.sqrt(2.0)
    noise = np.hypot(mean, added_m) / np.hypot(own, added_m)
    second = np.ones(1)
    walk = np.array(
        [step_scale(mean, second) / step_scale(one, second) for mean, one in zip(means, errors, strict=True)]
    ).ravel()
    return np.concatenate([noise, walk[chain.first][~chain.starts]])


def _noise_losses(fixes: Fixes, chain: OffsetChain, config: GpsConfig) -> list[Gaussian]:
    """Return the loss of each contributing fix's noise.

    The walk within the interval of an offset is part of the noise, else it would look like the speed of the
    path. It moves all fixes of the interval, so that many of them know no better.
    """
    rows = fixes.where(chain.rows)
    count = np.bincount(chain.offset)
    middle_s = np.bincount(chain.offset, rows.t_s) / count
    apart_s = np.abs(rows.t_s - middle_s[chain.offset])
    return [
        student(errors, float(np.hypot(errors.noise_m, np.sqrt(n) * walk_scale(errors, dt))), added_m)
        for errors, dt, n, added_m in zip(
            errors_of(rows, config), apart_s, count[chain.offset], rows.logging_sigma_m, strict=True
        )
    ]


def _walk_losses(fixes: Fixes, chain: OffsetChain, config: GpsConfig) -> dict[int, Gaussian]:
    """Return the losses of the offsets' steps from the one before, by offset."""
    first = fixes.where(chain.rows[chain.first])
    interval_s, errors = np.diff(first.t_s, prepend=np.nan), errors_of(first, config)
    walking = np.flatnonzero(~chain.starts).tolist()
    return {k: student(errors[k], float(step_scale(errors[k], interval_s[k]))) for k in walking}


def _noise_factors(
    fixes: Fixes,
    chain: OffsetChain,
    frame_t_s: FloatArray,
    sensors: Sensors,
    losses: list[Gaussian],
    antenna_velocity: FloatArray | None,
) -> gtsam.NonlinearFactorGraph:
    """Return a factor for each fix: the noise of antenna + offset - fix."""
    graph, placement = gtsam.NonlinearFactorGraph(), place(frame_t_s, fixes.t_s)
    for row, offset, loss in zip(chain.rows.tolist(), chain.offset.tolist(), losses, strict=True):
        a, b = int(placement.frame[row]), int(placement.frame[row]) + 1
        keys = gtsam.symbol("x", a), gtsam.symbol("x", b)
        alpha, fix = float(placement.alpha[row]), fixes.world_p_fix[row]
        if sensors.is_estimated:
            assert antenna_velocity is not None
            velocity, shared = antenna_velocity[row], (TIME_OFFSET, ANTENNA)
            factor = gps_factor_calibrating(keys, shared, alpha, fix, velocity, loss, offset_key(offset))
        else:
            antenna = sensors.camera_p_antenna
            factor = gps_factor_interpolated(keys, alpha, fix, antenna, loss, offset_key(offset))
        graph.push_back(factor)
    return graph


def _walk_factors(losses: dict[int, Gaussian]) -> gtsam.NonlinearFactorGraph:
    """Return a factor for each step of an offset from the one before."""
    graph, still = gtsam.NonlinearFactorGraph(), np.zeros(3)
    for k, loss in losses.items():
        graph.push_back(
            gtsam.BetweenFactorVector(offset_key(k - 1), offset_key(k), still, loss.noise_model())
        )
    return graph


def _errors(fixes: Fixes, chain: OffsetChain, path: Trajectory, sensors: Sensors) -> FloatArray:
    """Return fix minus antenna (M, 3) of each contributing fix."""
    return -antenna_offsets(fixes, path, sensors.camera_p_antenna)[chain.rows]
