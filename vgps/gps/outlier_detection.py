"""Outlier detection: the probability that each fix is what its class says, given the path and all others.

Nothing is gated on a first guess: all fixes are fitted together by a path that can bend only as a camera
drifts, first as if each were as coarse as the path is wrong, then finer and finer until each class counts
with its region. Where the displacement between two fixes is not the camera's, the fixes between two such
places are left out for a trial. The likeliest fit counts, by :mod:`vgps.gps.fix_states`. A verdict holds
until
the next assessment: later frames and fixes may reverse it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vgps.config import Config
from vgps.gps.drift_model import DriftModel
from vgps.gps.fix_states import LOWER, OWN, STILL_LOWER, state_probabilities
from vgps.gps.fixes import Fixes, place
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Trajectory

_ROUNDS = 6  # a guard: verdicts settle within a few


@dataclass(frozen=True)
class FixAssessment:
    """Probabilities (M,) that a fix is what its class says (``own``), or what the class below says
    (``lower``).

    The rest is the probability of an outlier. NaN where a fix was not assessed.
    """

    own: FloatArray
    lower: FloatArray

    @classmethod
    def none(cls, count: int) -> "FixAssessment":
        """Return the assessment of fixes that were not assessed yet."""
        return cls(np.full(count, np.nan), np.full(count, np.nan))

    @property
    def rejected(self) -> BoolArray:
        """(M,) whether each is more likely an outlier than anything else."""
        return np.asarray(1.0 - self.own - self.lower > np.maximum(self.own, self.lower))

    @property
    def lowered(self) -> BoolArray:
        """(M,) whether each is most likely what the class below says."""
        return np.asarray((self.lower > self.own) & ~self.rejected)

    def applied(self, fixes: Fixes) -> Fixes:
        """Return the fixes with the regions that their verdicts give them, outliers not used."""
        low = self.lowered
        return replace(
            fixes,
            r_m=np.where(low, fixes.lower_r_m, fixes.r_m),
            h_m=np.where(low, fixes.lower_h_m, fixes.h_m),
            shape=np.where(low[:, None], fixes.lower_shape, fixes.shape),
            sigma_m=np.where(low[:, None], np.nan, fixes.sigma_m),
            used=fixes.used & ~self.rejected,
        )

    def merged(self, more: "FixAssessment", order: IntArray) -> "FixAssessment":
        """Return this with the assessment of more fixes, in the order of :meth:`Fixes.merged`."""
        own, lower = np.concatenate([self.own, more.own]), np.concatenate([self.lower, more.lower])
        return FixAssessment(own[order], lower[order])

    def where(self, mask: BoolArray) -> "FixAssessment":
        """Return the assessment of the fixes ``mask`` (M,)."""
        return FixAssessment(self.own[mask], self.lower[mask])

    def updated(self, newer: "FixAssessment") -> "FixAssessment":
        """Return this with what a newer assessment covers."""
        rows = np.isfinite(newer.own)
        return FixAssessment(np.where(rows, newer.own, self.own), np.where(rows, newer.lower, self.lower))


def detects_outliers(config: Config) -> bool:
    """Return whether fixes are assessed: Cauchy's loss does without."""
    return config.outliers.enabled and config.gps.model not in {"none", "cauchy"}


def probabilities(
    offset: FloatArray, fixes: Fixes, config: Config, tolerance_m: float = 0.0
) -> FixAssessment:
    """Assess fixes by where the antenna was (:mod:`vgps.gps.fix_states`).

    Args:
        offset: (M, 3) antenna minus fix, metres; NaN gives NaN.
        fixes: In order of time; those without a region are not assessed.
        config: Priors, and the exponent and weight of the cylinder.
        tolerance_m: Error of the path itself.
    """
    found = FixAssessment.none(len(fixes))
    rows = np.isfinite(offset).all(axis=1) & np.isfinite(fixes.r_m)
    if rows.any():
        state, _ = state_probabilities(offset[rows], fixes.where(rows), config, tolerance_m)
        found.own[rows], found.lower[rows] = state[:, OWN], state[:, LOWER] + state[:, STILL_LOWER]
    return found


def detect_outliers(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> FixAssessment:
    """Assess the fixes within a path's time, the path free to bend as a camera drifts.

    Args:
        path: In the world, roughly.
        fixes: In time; those outside the path's time, or without a region, are not assessed.
        camera_p_antenna: (3,) metres.
        config: Priors, drift.
    """
    inside = fixes.used & place(path.t_s, fixes.t_s).inside
    if inside.sum() < 2:
        return FixAssessment.none(len(fixes))
    sigmas_s = {0.0, config.sensors.time_offset_prior_s}  # the clock is right, or not
    models = [
        DriftModel(path, fixes.where(inside), camera_p_antenna, config.drift, time_offset_sigma_s)
        for time_offset_sigma_s in sorted(sigmas_s)
    ]
    found = _assess(models, fixes.where(inside), _tolerance(path, models[0].knots, config), config)
    out = FixAssessment.none(len(fixes))
    out.own[inside], out.lower[inside] = found.own, found.lower
    return out


def _assess(models: list[DriftModel], fixes: Fixes, tolerance_m: float, config: Config) -> FixAssessment:
    """Assess fixes at the likeliest of several fits.

    They start from the path as it is, and from coarse fits to all fixes; then from fits without runs of fixes
    that are believed though they are suspect.
    """
    everything = np.ones(len(fixes), dtype=bool)

    def likelier(than: "_Fit | None", starts: Callable[[DriftModel], Iterable[FloatArray]]) -> "_Fit":
        ends = [
            _alternated(model, start, fixes, tolerance_m, config)
            for model in models
            for start in starts(model)
        ]
        return min([than, *ends] if than else ends, key=lambda end: end.energy)

    best = likelier(None, lambda model: (model.start, model.fit_coarse_to_fine(everything, tolerance_m)))
    believed = ~probabilities(best.offset, fixes, config, tolerance_m).rejected
    runs = suspect_runs(
        models[0].offsets(models[0].start), believed, fixes, config.outliers.max_jumps, tolerance_m
    )
    if runs:
        best = likelier(
            best, lambda model: (model.fit_coarse_to_fine(believed & ~run, tolerance_m) for run in runs)
        )
    return probabilities(best.offset, fixes, config, tolerance_m)


def suspect_runs(
    offset: FloatArray, believed: BoolArray, fixes: Fixes, max_jumps: int, tolerance_m: float = 0.0
) -> list[BoolArray]:
    """Return runs of fixes (M,) that may share an error: between places where the offset jumps.

    Args:
        offset: (M, 3) antenna minus fix, metres, by the path as it is.
        believed: (M,) fixes that are looked at.
        fixes: In order of time.
        max_jumps: Jumps at most, largest first.
        tolerance_m: Error of the path itself from one fix to the next.
    """
    rows = np.flatnonzero(believed)
    step, r, h = np.diff(offset[rows], axis=0), fixes.r_m[rows], fixes.h_m[rows]
    beyond = np.maximum(
        np.hypot(step[:, 0], step[:, 1]) / (r[1:] + r[:-1] + tolerance_m),
        np.abs(step[:, 2]) / (h[1:] + h[:-1] + tolerance_m),
    )
    jumps = np.flatnonzero(beyond > 1.0)
    jumps = np.sort(jumps[np.argsort(-beyond[jumps], kind="stable")[:max_jumps]])
    runs = np.split(rows, jumps + 1)
    return [np.isin(np.arange(len(offset)), run) for run in runs if 2 <= len(run) <= len(rows) // 2]


class _Fit(NamedTuple):
    """Minus the log of the likelihood of path and fixes, but for a constant, and the offsets (M, 3) there."""

    energy: float
    offset: FloatArray


def _alternated(
    model: DriftModel, parameters: FloatArray, fixes: Fixes, tolerance_m: float, config: Config
) -> _Fit:
    """Assess and fit in turn until the verdicts stay."""
    found = probabilities(model.offsets(parameters), fixes, config, tolerance_m)
    for _ in range(_ROUNDS):
        believed = found.applied(fixes)
        regions = np.stack([believed.r_m, believed.r_m, believed.h_m], axis=1)
        parameters = model.refine(parameters, believed.used, regions)
        before, found = found, probabilities(model.offsets(parameters), fixes, config, tolerance_m)
        if np.array_equal(before.rejected, found.rejected) and np.array_equal(before.lowered, found.lowered):
            break
    offset = model.offsets(parameters)
    _, log_likelihood = state_probabilities(offset, fixes, config, tolerance_m)
    return _Fit(0.5 * model.prior_cost(parameters) - log_likelihood, offset)


def _tolerance(path: Trajectory, knots: int, config: Config) -> float:
    """Return by how much the path between two knots may be wrong, metres."""
    return max(config.outliers.path_tolerance * path.length_m / knots, 0.01)
