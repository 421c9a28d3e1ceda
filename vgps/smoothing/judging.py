"""Which fixes to believe: the probability of each, by what the path and all the others say.

A fix is what its class says, or what the class below says (a wrong integer ambiguity leaves an RTK-fix with
an RTK-float's error), or an outlier anywhere within tens of metres. Each hypothesis gives a density of the
offset between antenna and fix; Bayes' rule gives their probabilities. Nothing is gated on a first guess: all
fixes are fitted together by a path that can bend only as a camera drifts, first as if each were as coarse as
the path is wrong, then finer and finer until classes count for what they say. A verdict holds until it is
asked for again: later frames and fixes may reverse it.
"""

from dataclasses import dataclass, replace
from math import gamma

import numpy as np

from vgps.config import Config
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.smoothing.fixes import Fixes, place
from vgps.smoothing.flexible_path import FlexiblePath

_ROUNDS = 6


@dataclass(frozen=True)
class Judgement:
    """Probabilities (M,) that a fix is what its class says (``own``), or what the class below says
    (``lower``); the rest is the probability of an outlier. NaN where a fix was not judged."""

    own: FloatArray
    lower: FloatArray

    @classmethod
    def none(cls, count: int) -> "Judgement":
        """Nothing judged yet."""
        return cls(np.full(count, np.nan), np.full(count, np.nan))

    @property
    def rejected(self) -> BoolArray:
        """(M,) more likely an outlier than anything else."""
        return np.asarray(1.0 - self.own - self.lower > np.maximum(self.own, self.lower))

    @property
    def lowered(self) -> BoolArray:
        """(M,) most likely what the class below says."""
        return np.asarray((self.lower > self.own) & ~self.rejected)

    def applied(self, fixes: Fixes) -> Fixes:
        """The fixes with the regions they deserve, outliers not used."""
        low = self.lowered
        return replace(
            fixes,
            r_m=np.where(low, fixes.lower_r_m, fixes.r_m),
            h_m=np.where(low, fixes.lower_h_m, fixes.h_m),
            sigma_m=np.where(low[:, None], np.nan, fixes.sigma_m),
            used=fixes.used & ~self.rejected,
        )

    def joined(self, more: "Judgement", order: IntArray) -> "Judgement":
        """With the judgement of more fixes, in the order of :meth:`Fixes.joined`."""
        own, lower = np.concatenate([self.own, more.own]), np.concatenate([self.lower, more.lower])
        return Judgement(own[order], lower[order])

    def where(self, mask: BoolArray) -> "Judgement":
        """Of those that ``mask`` (M,) names."""
        return Judgement(self.own[mask], self.lower[mask])

    def updated(self, newer: "Judgement") -> "Judgement":
        """With what a newer one judged."""
        rows = np.isfinite(newer.own)
        return Judgement(np.where(rows, newer.own, self.own), np.where(rows, newer.lower, self.lower))


def judges(config: Config) -> bool:
    """Whether fixes are judged: Cauchy's loss does without."""
    return config.judge.enabled and config.gps.model not in {"none", "cauchy"}


def probabilities(offset: FloatArray, fixes: Fixes, config: Config, tolerance_m: float = 0.0) -> Judgement:
    """Bayes' rule over the hypotheses, given where the antenna was.

    The density inside a class is that of the cylinder, ``exp(-omega Psi) / Z``, Eq. (11)(16), Kume 2010. A
    survey drops its worst epochs, so a small share of a class lies in a cylinder of a larger size. An outlier
    lies anywhere within ``outlier_radius_m`` of the antenna.

    Args:
        offset: (M, 3) antenna minus fix, metres; NaN gives NaN.
        fixes: Their own regions and those of the class below.
        config: Priors, and the exponent and weight of the cylinder.
        tolerance_m: How far off the path itself may be.
    """
    own, lower, bad = _log_likelihoods(offset, fixes, config, tolerance_m)
    with np.errstate(invalid="ignore"):  # what has no region has no likelihood
        total = np.logaddexp(np.logaddexp(own, lower), bad)
    return Judgement(np.exp(own - total), np.where(np.isnan(total), np.nan, np.exp(lower - total)))


def _log_likelihoods(
    offset: FloatArray, fixes: Fixes, config: Config, tolerance_m: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(M,) logs of prior times density [1/m^3]: own class, class below, outlier."""
    judge = config.judge
    own = _log_class_density(offset, fixes.r_m, fixes.h_m, config, tolerance_m)
    lower = _log_class_density(offset, fixes.lower_r_m, fixes.lower_h_m, config, tolerance_m)
    has_lower = np.isfinite(fixes.lower_r_m)
    own += np.log(1.0 - judge.outlier_share - np.where(has_lower, judge.lower_share, 0.0))
    lower = np.where(has_lower, lower + np.log(judge.lower_share), -np.inf)
    volume = 2.0 * np.pi * judge.outlier_radius_m**3
    return own, lower, np.full(len(offset), np.log(judge.outlier_share / volume))


def _log_class_density(
    offset: FloatArray, r_m: FloatArray, h_m: FloatArray, config: Config, tolerance_m: float
) -> FloatArray:
    judge = config.judge
    core = _log_density(offset, r_m, h_m, config, tolerance_m)
    tail = _log_density(offset, judge.tail_size * r_m, judge.tail_size * h_m, config, tolerance_m)
    with np.errstate(invalid="ignore"):  # no region, no density
        both = np.logaddexp(core + np.log(1.0 - judge.tail_share), tail + np.log(judge.tail_share))
    return np.asarray(both)


def _log_density(
    offset: FloatArray, r_m: FloatArray, h_m: FloatArray, config: Config, tolerance_m: float
) -> FloatArray:
    """(M,) log of the cylinder's density [1/m^3]; NaN without a region."""
    n, omega = config.gps.n, config.gps.omega
    r, h = np.hypot(r_m, tolerance_m), np.hypot(h_m, tolerance_m)
    horizontal, vertical = np.hypot(offset[:, 0], offset[:, 1]) / r, np.abs(offset[:, 2]) / h
    with np.errstate(over="ignore"):
        psi = horizontal ** (2 * n) + vertical ** (2 * n)
    # the integral of exp(-omega Psi) over space
    area = np.pi * r**2 * gamma(1.0 + 1.0 / n) * omega ** (-1.0 / n)
    length = 2.0 * h * gamma(1.0 + 0.5 / n) * omega ** (-0.5 / n)
    return np.asarray(-omega * psi - np.log(area * length))


def judge_on_path(
    poses: FloatArray, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> Judgement:
    """Judge the fixes within a path's time, the path free to bend as a camera drifts.

    Args:
        poses: (F, 4, 4) in the world, roughly.
        t_s: (F,).
        fixes: All; those outside the path's time, or without a region, are not judged.
        camera_p_antenna: (3,) metres.
        config: Priors, drift.
    """
    judged = fixes.used & place(t_s, fixes.t_s).inside
    if judged.sum() < 2:
        return Judgement.none(len(fixes))
    clocks = {0.0, config.sensors.lag_prior_s}  # in step, or not
    paths = [
        FlexiblePath(poses, t_s, fixes.where(judged), camera_p_antenna, config.drift, lag_sigma_s)
        for lag_sigma_s in sorted(clocks)
    ]
    found = _judge(paths, fixes.where(judged), _tolerance(poses, paths[0].knots, config), config)
    out = Judgement.none(len(fixes))
    out.own[judged], out.lower[judged] = found.own, found.lower
    return out


def _judge(paths: list[FlexiblePath], fixes: Fixes, tolerance_m: float, config: Config) -> Judgement:
    """At the most likely of several ends: from the path as it is, and from coarse fits to all fixes."""
    ends = []
    for path in paths:
        for start in (path.start, path.approach(np.ones(len(fixes), dtype=bool), tolerance_m)):
            end = _settled(path, start, fixes, tolerance_m, config)
            ends.append((_energy(path, end, fixes, tolerance_m, config), path.offsets(end)))
    _, offset = min(ends, key=lambda end: end[0])
    return probabilities(offset, fixes, config, tolerance_m)


def _settled(
    path: FlexiblePath, parameters: FloatArray, fixes: Fixes, tolerance_m: float, config: Config
) -> FloatArray:
    """Judge and fit in turn until the verdicts stay."""
    found = probabilities(path.offsets(parameters), fixes, config, tolerance_m)
    for _ in range(_ROUNDS):
        believed = found.applied(fixes)
        regions = np.stack([believed.r_m, believed.r_m, believed.h_m], axis=1)
        parameters = path.settle(parameters, believed.used, regions)
        before, found = found, probabilities(path.offsets(parameters), fixes, config, tolerance_m)
        if np.array_equal(before.rejected, found.rejected) and np.array_equal(before.lowered, found.lowered):
            break
    return parameters


def _energy(
    path: FlexiblePath, parameters: FloatArray, fixes: Fixes, tolerance_m: float, config: Config
) -> float:
    """Minus the log of everything's likelihood, but for a constant."""
    own, lower, bad = _log_likelihoods(path.offsets(parameters), fixes, config, tolerance_m)
    return 0.5 * path.bending(parameters) - float(np.logaddexp(np.logaddexp(own, lower), bad).sum())


def _tolerance(poses: FloatArray, knots: int, config: Config) -> float:
    """What the way between two knots may be wrong by."""
    way = float(np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).sum())
    return max(config.judge.path_tolerance * way / knots, 0.01)
