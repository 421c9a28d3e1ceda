"""Noise and walk of the fix classes, and how long its rate lasts, learned from the recording itself.

From one fix to the next, the displacement of the fixes differs from that of the antenna by the noise and
the walk of their error, and by the error of the video, a small share of the distance. Receivers differ by
orders of magnitude in how their errors walk, so the constants of a class are only a prior: its posterior
over a grid gives the constants for this log.

A path that was bent to follow such fixes differs little from them, whatever their error is. So the first
solution takes the errors to be as large as those of any receiver (:func:`largest_errors`), and RTK-fixes keep
the constants of their class, since every path follows them; but for a noise that is larger than that of any
receiver, as where their antenna is carried beside the camera.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vgps.config import Config, GpsConfig
from vgps.config.gps import OffsetErrors
from vgps.gps.antenna_path import place
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.fix_factors import contributing_fixes
from vgps.gps.fixes import CLASSES, Fixes, independent_epochs
from vgps.gps.frame_gaps import in_gaps
from vgps.gps.neighbour_pairs import MEDIAN, NeighbourPairs
from vgps.gps.offsets import chain_offsets
from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.solution import Trajectory

_LARGEST_SIGMAS = 3.0  # of the spread between receivers
_SPAN_SIGMAS = 3.0  # of the priors, covered by the grid
_LAGS_S = (0.0, 1.0, 3.0, 10.0)  # noise shows in neighbours, walk and rate in how differences grow
_MAX_PAIRS = 150  # of a class at each lag; more hardly sharpen two numbers
_KNOWN = {"noise_spread": 0.0, "walk_spread": 0.0, "rate_spread": 0.0}
_WALKS, _NOISES, _SHARES, _RATES = 49, 25, 7, 7  # values of the grid
_LEAST_PAIRS = 5  # of a class at a lag
_AT_ONCE_S = 1e-6  # that a rate lasts in a walk at random
_NEAR = 1.05  # of the shortest interval
_UPPER = 0.84  # of the posterior of the walk lies below what counts: a standard deviation above its middle


@dataclass(frozen=True)
class LearnedErrors:
    """What a log shows of the errors of a class, as in :class:`~vgps.config.gps.OffsetErrors`.

    All are as large as they may well be: what is unknown about them is part of them.
    """

    noise_m: float
    walk_m: float
    rate_lasts_s: float


class _Pairs(NamedTuple):
    """Pairs (n,) of fixes: difference of displacements [m], interval [s], distance of the camera [m]."""

    difference_m: FloatArray
    interval_s: FloatArray
    length_m: FloatArray


def largest_errors(config: GpsConfig) -> dict[FixClass, LearnedErrors]:
    """Return errors as large as those of any receiver, of all classes but RTK-fix."""
    return {
        name: LearnedErrors(
            _largest_noise(errors),
            errors.walk_m * float(np.exp(_LARGEST_SIGMAS * errors.walk_spread)),
            errors.rate_lasts_s * float(np.exp(_LARGEST_SIGMAS * errors.rate_spread)),
        )
        for name, errors in config.memory.classes.items()
        if config.learns and name in config.regions and name is not FixClass.RTK_FIX
    }


def _largest_noise(errors: OffsetErrors) -> float:
    return errors.noise_m * float(np.exp(_LARGEST_SIGMAS * errors.noise_spread))


def with_errors(config: GpsConfig, learned: Mapping[FixClass, LearnedErrors]) -> GpsConfig:
    """Return settings with the learned errors of some classes."""
    classes = {
        name: config.offset_errors(name).model_copy(update={**vars(errors), **_KNOWN})
        for name, errors in learned.items()
    }
    memory = config.memory.model_copy(update={"classes": {**config.memory.classes, **classes}})
    return config.model_copy(update={"memory": memory})


def learn_errors(
    fixes: Fixes, path: Trajectory, torn: BoolArray, camera_p_antenna: FloatArray, config: Config
) -> dict[FixClass, LearnedErrors]:
    """Return the errors of the classes of a log that has enough fixes of them; of usual RTK-fixes none.

    Fixes in gaps between frames say nothing of these, nor do pairs of fixes with a tear of the path between.

    Args:
        fixes: Fixes with their verdicts applied and their time offset removed.
        path: The path (F), fitted with :func:`largest_errors`.
        torn: (F - 1,) places between its frames where it is torn.
        camera_p_antenna: (3,) metres.
        config: Priors of the classes, and how displacements are compared.
    """
    contributing = contributing_fixes(fixes, path.t_s, config.gps)
    if not contributing.any():
        return {}
    config, learned = _of_a_placed_path(config, fixes.where(contributing)), {}
    seen = contributing & ~in_gaps(path.t_s, fixes.t_s)
    piece = np.append(0, np.cumsum(torn))[place(path.t_s, fixes.t_s).frame]
    for k in np.unique(fixes.fix_class[contributing]).tolist():
        if not config.gps.learns:
            continue
        own = seen & (fixes.fix_class == k)
        pairs = _pairs_of_class(fixes, own, piece, path, camera_p_antenna, config)
        if pairs is None:
            continue
        errors = config.gps.offset_errors(CLASSES[k])
        added_m = float(np.sqrt(np.mean(fixes.logging_sigma_m[own, :2] ** 2)))
        if CLASSES[k] is not FixClass.RTK_FIX:
            learned[CLASSES[k]] = _posterior(pairs, errors, config.gps, added_m)
        elif (noise_m := _neighbours_noise(pairs, config.gps, added_m)) > _largest_noise(errors):
            learned[CLASSES[k]] = LearnedErrors(noise_m, errors.walk_m, errors.rate_lasts_s)
    return learned


def _of_a_placed_path(config: Config, placing: Fixes) -> Config:
    """Return settings that compare displacements along a path whose place in the world fixes (M,) tell.

    They tell its scale and heading, and the video lets these drift a little in between. With the freedom that
    a path without fixes needs, they would follow errors that drift steadily.
    """
    weight = independent_epochs(placing) / region_sigmas(placing)[:, 0] ** 2
    place = placing.world_p_fix[:, :2]
    information = weight @ np.sum((place - weight @ place / weight.sum()) ** 2, axis=1)
    compared, drift = config.sensors.time_offset, config.gps.memory.path_share
    known = max(information, compared.factor_sigma**-2)
    sigma = min(float(np.hypot(drift, known**-0.5)), compared.factor_sigma)
    compared = compared.model_copy(update={"factor_sigma": sigma, "common_factor_sigma": 0.0})
    sensors = config.sensors.model_copy(update={"time_offset": compared})
    return config.model_copy(update={"sensors": sensors})


def _pairs_of_class(
    fixes: Fixes,
    own: BoolArray,
    piece: IntArray,
    path: Trajectory,
    camera_p_antenna: FloatArray,
    config: Config,
) -> _Pairs | None:
    """Return the pairs of fixes of one class (M,) within stretches, and within pieces (M,) of the path:
    neighbours and further apart."""
    chain = chain_offsets(fixes, own, config.gps)
    # both numbers ascend, so that their sum changes with either
    stretch: IntArray = np.cumsum(chain.starts)[chain.offset].astype(np.int64) + piece[chain.rows]
    rows, found, before = fixes.where(chain.rows), [], 0
    since_s = rows.t_s - rows.t_s[np.searchsorted(stretch, stretch)]
    for lag_s in _LAGS_S:
        kept = _first_of_each(stretch, since_s, lag_s)
        if len(kept) == before:  # fixes lie that far apart anyway
            continue
        before = len(kept)
        pairs = _compared(rows.where(kept), stretch[kept], path, camera_p_antenna, config)
        found += [] if pairs is None else [pairs]
    return _Pairs(*(np.concatenate(columns) for columns in zip(*found, strict=True))) if found else None


def _first_of_each(stretch: IntArray, since_s: FloatArray, lag_s: float) -> IntArray:
    """Return the first row of each interval of this length in each stretch; every row if it is zero."""
    interval = np.floor(since_s / lag_s + 1e-6) if lag_s else np.arange(len(since_s))
    return np.flatnonzero((np.diff(stretch, prepend=0) != 0) | (np.diff(interval, prepend=-1.0) != 0))


def _compared(
    fixes: Fixes, stretch: IntArray, path: Trajectory, camera_p_antenna: FloatArray, config: Config
) -> _Pairs | None:
    """Return the pairs of neighbours in the same stretch (M,); None if they are too few to compare."""
    rows = np.flatnonzero(np.diff(stretch) == 0)
    pairs = NeighbourPairs(path, fixes, camera_p_antenna, rows, config.sensors.time_offset)
    if pairs.count < _LEAST_PAIRS or (left := 2.0 * pairs.count - pairs.absorbed()) < pairs.count:
        return None
    lost = 2.0 * pairs.count / left  # to the factors of scale and heading
    few = np.unique(np.linspace(0, pairs.count - 1, _MAX_PAIRS).astype(int))
    columns = pairs.difference(0.0) * np.sqrt(lost), pairs.interval_s, pairs.length_m
    return _Pairs(*(column[few] for column in columns))


def _posterior(pairs: _Pairs, errors: OffsetErrors, config: GpsConfig, added_m: float) -> LearnedErrors:
    """Return the root mean square of the noise under its posterior, and an upper limit of the walk.

    Smaller choices, as the means of the logs, would trust the shape of a log that says little about both: a
    path that is bent to a log that drifts errs by more than one that leaves the shape of a good log unused.
    """
    memory, tail = config.memory, errors.tail
    walk, walk_prior = _grid(errors.walk_m, errors.walk_spread, _WALKS)
    noise, noise_prior = _grid(errors.noise_m, errors.noise_spread, _NOISES)
    share, share_prior = _grid(memory.path_share, memory.path_spread, _SHARES)
    fixed = 2.0 * (noise[:, None, None] ** 2 + added_m**2)
    fixed = fixed + np.multiply.outer(share, pairs.length_m) ** 2
    rate, rate_prior = _rates(errors)
    log = np.empty((len(rate), _WALKS, _NOISES, _SHARES))
    for k in range(len(rate)):
        walked = np.multiply.outer(walk, _growth(float(rate[k]), pairs.interval_s, tail))[:, None, None]
        squared = walked**2 + fixed  # (walks, noises, shares, n)
        density = -np.log(squared) - (tail + 2.0) / 2.0 * np.log1p(pairs.difference_m**2 / squared / tail)
        log[k] = density.sum(axis=-1) + rate_prior[k]
    log += walk_prior[:, None, None] + noise_prior[:, None] + share_prior
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    walk_m = _upper_limit(walk, weight.sum(axis=(0, 2, 3)))
    return LearnedErrors(
        noise_m=float(np.sqrt(weight.sum(axis=(0, 1, 3)) @ noise**2)),
        walk_m=walk_m,
        rate_lasts_s=_rate_of_walk(walk_m, rate, walk, weight.sum(axis=(2, 3)))
        if errors.rate_spread
        else errors.rate_lasts_s,
    )


def _rates(errors: OffsetErrors) -> tuple[FloatArray, FloatArray]:
    """Return times (R,) that rates of change may last, and the logs of their densities."""
    if errors.rate_spread:
        return _grid(errors.rate_lasts_s, errors.rate_spread, _RATES)
    # a receiver's filter smooths its errors within a second, or not
    return np.array([_AT_ONCE_S, 1.0]), np.zeros(2)


def _growth(rate_lasts_s: float, interval_s: FloatArray, tail: float) -> FloatArray:
    """Return the changes of an error over intervals (n,), over that in one second.

    They grow evenly for the time that a rate lasts, and then as sums of such steps, as in
    :func:`~vgps.gps.offset_errors.walk_scale`.
    """
    power = 1.0 / min(tail, 2.0)
    summed = rate_lasts_s ** (1.0 - power)
    return np.asarray(np.minimum(interval_s, summed * interval_s**power) / min(1.0, summed))


def _rate_of_walk(walk_m: float, rate: FloatArray, walk: FloatArray, weight: FloatArray) -> float:
    """Return how long the rate of a walk lasts that leads as far in the long run as the error may well do.

    Args:
        walk_m: Over one second.
        rate, walk, weight: Values (R,) and (W,), and their posterior (R, W).
    """
    # a rate that lasts for less than a second leads no further than steps of a second
    far = np.multiply.outer(np.sqrt(np.maximum(rate, 1.0)), walk).ravel()
    order = np.argsort(far)
    return max(1.0, (_upper_limit(far[order], weight.ravel()[order]) / walk_m) ** 2)


def _neighbours_noise(pairs: _Pairs, config: GpsConfig, added_m: float) -> float:
    """Return the noise on an axis by the median of the closest neighbours, beside what logging added."""
    near = pairs.interval_s <= _NEAR * pairs.interval_s.min()
    of_path_m = config.memory.path_share * pairs.length_m[near]
    squared = float(np.median((pairs.difference_m[near] / MEDIAN) ** 2 - of_path_m**2))
    return float(np.sqrt(max(squared / 2.0 - added_m**2, 0.0)))


def _upper_limit(values: FloatArray, weight: FloatArray) -> float:
    """Return what most of a distribution over the values (n,) of a grid lies below."""
    below = np.cumsum(weight) - weight / 2.0
    return float(np.exp(np.interp(_UPPER, below, np.log(values))))


def _grid(median: float, spread: float, count: int) -> tuple[FloatArray, FloatArray]:
    """Return values of a log-normal distribution (count,), and the logs of their densities."""
    sigmas = np.linspace(-_SPAN_SIGMAS, _SPAN_SIGMAS, count)
    return median * np.exp(spread * sigmas), -0.5 * sigmas**2
