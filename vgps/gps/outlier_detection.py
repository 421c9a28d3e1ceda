"""Outlier detection: the probability that each fix has the error of its class, given the path and all fixes.

Fixes are not gated on an initial estimate. All of them are fitted together by a path that deforms only as
visual odometry drifts, first with regions as large as the error of the path, then with ever smaller ones down
to those of the classes. Where the displacement between two fixes differs from the camera's, their offset
jumps; the run of fixes between two jumps is left out on trial. The fit of highest likelihood by
:mod:`vgps.gps.fix_states` decides. A verdict holds until the next assessment: later frames and fixes may
reverse it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vgps.config import Config
from vgps.gps.drift_model import DriftModel
from vgps.gps.fix_states import LOWER, NOMINAL, REPEATED_LOWER, REPEATED_NOMINAL, state_probabilities
from vgps.gps.fixes import CLASSES, Fixes, place
from vgps.gps.regions import lower_class
from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.solution import Trajectory

_ROUNDS = 6  # upper limit; verdicts converge within a few


@dataclass(frozen=True)
class FixAssessment:
    """Probabilities (M,) that the error of a fix is that of its class, and that of the class below.

    The remainder is the probability of an outlier. NaN where a fix was not assessed.
    """

    nominal: FloatArray
    lower: FloatArray

    @classmethod
    def unassessed(cls, count: int) -> "FixAssessment":
        """Return the assessment of fixes that have not been assessed."""
        return cls(np.full(count, np.nan), np.full(count, np.nan))

    @property
    def rejected(self) -> BoolArray:
        """(M,) whether each fix is most likely an outlier."""
        return np.asarray(1.0 - self.nominal - self.lower > np.maximum(self.nominal, self.lower))

    @property
    def down_classed(self) -> BoolArray:
        """(M,) whether each fix most likely has the error of the class below."""
        return np.asarray((self.lower > self.nominal) & ~self.rejected)

    def applied(self, fixes: Fixes) -> Fixes:
        """Return the fixes with the regions of their verdicts; outliers are not used."""
        low = self.down_classed
        return replace(
            fixes,
            r_m=np.where(low, fixes.lower_r_m, fixes.r_m),
            h_m=np.where(low, fixes.lower_h_m, fixes.h_m),
            shape=np.where(low[:, None], fixes.lower_shape, fixes.shape),
            sigma_m=np.where(low[:, None], np.nan, fixes.sigma_m),
            fix_class=np.where(low, CLASSES.index(lower_class(FixClass.RTK_FIX)), fixes.fix_class),
            used=fixes.used & ~self.rejected,
        )

    def merged(self, more: "FixAssessment", order: IntArray) -> "FixAssessment":
        """Return the assessment of both sets of fixes, in the order of :meth:`Fixes.merged`."""
        nominal = np.concatenate([self.nominal, more.nominal])
        return FixAssessment(nominal[order], np.concatenate([self.lower, more.lower])[order])

    def where(self, mask: BoolArray) -> "FixAssessment":
        """Return the assessment of the fixes for which ``mask`` (M,) is true."""
        return FixAssessment(self.nominal[mask], self.lower[mask])

    def updated(self, newer: "FixAssessment") -> "FixAssessment":
        """Return the newer assessment where it covers a fix, else this one."""
        rows = np.isfinite(newer.nominal)
        return FixAssessment(
            np.where(rows, newer.nominal, self.nominal), np.where(rows, newer.lower, self.lower)
        )


def detects_outliers(config: Config) -> bool:
    """Return whether fixes are assessed; Cauchy's loss needs no verdicts."""
    return config.outliers.enabled and config.gps.model not in {"none", "cauchy"}


def assess_offsets(
    offset: FloatArray, fixes: Fixes, config: Config, tolerance_m: float = 0.0
) -> FixAssessment:
    """Assess fixes by their offsets from the antenna (:mod:`vgps.gps.fix_states`).

    Args:
        offset: (M, 3) antenna minus fix, metres; NaN gives NaN.
        fixes: In chronological order; those without a region are not assessed.
        config: Priors, and the exponent and weight of the cylinder.
        tolerance_m: Error of the path itself.
    """
    assessment = FixAssessment.unassessed(len(fixes))
    rows = np.isfinite(offset).all(axis=1) & np.isfinite(fixes.r_m)
    if rows.any():
        state, _ = state_probabilities(offset[rows], fixes.where(rows), config, tolerance_m)
        assessment.nominal[rows] = state[:, NOMINAL] + state[:, REPEATED_NOMINAL]
        assessment.lower[rows] = state[:, LOWER] + state[:, REPEATED_LOWER]
    return assessment


def detect_outliers(
    path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> FixAssessment:
    """Assess the fixes within the time span of a path, which may deform as visual odometry drifts.

    Args:
        path: Approximate path in the world.
        fixes: Fixes with the time offset removed; those outside the path's time span, or without a region,
            are not assessed.
        camera_p_antenna: (3,) metres.
        config: Priors and drift rates.
    """
    inside = fixes.used & place(path.t_s, fixes.t_s).inside
    if inside.sum() < 2:
        return FixAssessment.unassessed(len(fixes))
    sigmas_s = {0.0, config.sensors.time_offset_prior_s}  # without and with a time offset
    models = [
        DriftModel(path, fixes.where(inside), camera_p_antenna, config.drift, time_offset_sigma_s)
        for time_offset_sigma_s in sorted(sigmas_s)
    ]
    within = _assess(models, fixes.where(inside), _tolerance(path, models[0].knots, config), config)
    assessment = FixAssessment.unassessed(len(fixes))
    assessment.nominal[inside], assessment.lower[inside] = within.nominal, within.lower
    return assessment


def _assess(models: list[DriftModel], fixes: Fixes, tolerance_m: float, config: Config) -> FixAssessment:
    """Assess fixes at the most likely of several fits.

    The fits start from the given path and from coarse fits to all fixes, then from fits to all accepted fixes
    except one suspect run.
    """
    everything = np.ones(len(fixes), dtype=bool)

    def likeliest(than: "_Fit | None", starts: Callable[[DriftModel], Iterable[FloatArray]]) -> "_Fit":
        ends = [
            _alternate(model, start, fixes, tolerance_m, config)
            for model in models
            for start in starts(model)
        ]
        return min([than, *ends] if than else ends, key=lambda end: end.energy)

    best = likeliest(None, lambda model: (model.start, model.fit_coarse_to_fine(everything, tolerance_m)))
    accepted = ~assess_offsets(best.offset, fixes, config, tolerance_m).rejected
    runs = suspect_runs(
        models[0].offsets(models[0].start), accepted, fixes, config.outliers.max_jumps, tolerance_m
    )
    if runs:
        best = likeliest(
            best, lambda model: (model.fit_coarse_to_fine(accepted & ~run, tolerance_m) for run in runs)
        )
    return assess_offsets(best.offset, fixes, config, tolerance_m)


def suspect_runs(
    offset: FloatArray, accepted: BoolArray, fixes: Fixes, max_jumps: int, tolerance_m: float = 0.0
) -> list[BoolArray]:
    """Return runs of fixes, a mask (M,) each, that may share an error: those between jumps of the offset.

    Args:
        offset: (M, 3) antenna minus fix, metres, along the given path.
        accepted: (M,) fixes to consider.
        fixes: In chronological order.
        max_jumps: Number of jumps, the largest ones, to consider.
        tolerance_m: Error of the path from one fix to the next.
    """
    rows = np.flatnonzero(accepted)
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
    """Negative log-likelihood of path and fixes up to a constant, and the offsets (M, 3) of the fit."""

    energy: float
    offset: FloatArray


def _alternate(
    model: DriftModel, parameters: FloatArray, fixes: Fixes, tolerance_m: float, config: Config
) -> _Fit:
    """Assess and fit in turn until the verdicts no longer change."""
    current = assess_offsets(model.offsets(parameters), fixes, config, tolerance_m)
    for _ in range(_ROUNDS):
        assessed = current.applied(fixes)
        regions = np.stack([assessed.r_m, assessed.r_m, assessed.h_m], axis=1)
        parameters = model.refine(parameters, assessed.used, regions)
        before, current = current, assess_offsets(model.offsets(parameters), fixes, config, tolerance_m)
        same = np.array_equal(before.rejected, current.rejected)
        if same and np.array_equal(before.down_classed, current.down_classed):
            break
    offset = model.offsets(parameters)
    _, log_likelihood = state_probabilities(offset, fixes, config, tolerance_m)
    return _Fit(0.5 * model.prior_cost(parameters) - log_likelihood, offset)


def _tolerance(path: Trajectory, knots: int, config: Config) -> float:
    """Return the tolerated error of the path between two knots, metres."""
    return max(config.outliers.path_tolerance * path.length_m / knots, 0.01)
