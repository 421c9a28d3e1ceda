"""Outlier detection: the probability that each fix has the error of its class, given the path and all fixes.

Fixes are not gated on an initial estimate. All of them are fitted together by a path that deforms only as
visual odometry drifts, first with regions as large as the error of the path, then with ever smaller ones down
to those of the classes. Where the displacement between two fixes differs from the camera's, their offset
jumps; the run of fixes between two jumps is left out on trial (:mod:`vgps.gps.suspect_runs`). The fit of
highest likelihood by :mod:`vgps.gps.fix_states` decides. A verdict holds until the next assessment: later
frames and fixes may reverse it.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vgps.config import Config
from vgps.gps.antenna_path import place
from vgps.gps.drift_model import DriftModel
from vgps.gps.fix_states import (
    LOWER,
    NOMINAL,
    REPEATED_LOWER,
    REPEATED_NOMINAL,
    drawn_anew,
    state_probabilities,
)
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.regions import lower_class
from vgps.gps.suspect_runs import Stretches, better_without, suspect_runs, trial_masks
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

    def agrees_with(self, other: "FixAssessment") -> bool:
        """Return whether both come to the same verdicts."""
        return np.array_equal(self.rejected, other.rejected) and np.array_equal(
            self.down_classed, other.down_classed
        )

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
        known, _ = _assessed(offset[rows], fixes.where(rows), config, tolerance_m)
        assessment.nominal[rows], assessment.lower[rows] = known.nominal, known.lower
    return assessment


def _assessed(
    offset: FloatArray, fixes: Fixes, config: Config, tolerance_m: float
) -> tuple[FixAssessment, FloatArray]:
    """Return the assessment of fixes with offsets, and the log (M,) of each offset's density."""
    state, log_likelihood = state_probabilities(offset, fixes, config, tolerance_m)
    nominal = state[:, NOMINAL] + state[:, REPEATED_NOMINAL]
    return FixAssessment(nominal, state[:, LOWER] + state[:, REPEATED_LOWER]), log_likelihood


def detect_outliers(
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    seams: FloatArray | None = None,
) -> FixAssessment:
    """Assess the fixes within the time span of a path, which may deform as visual odometry drifts.

    Args:
        path: Approximate path in the world.
        fixes: Fixes with the time offset removed; those outside the path's time span, or without a region,
            are not assessed.
        camera_p_antenna: (3,) metres.
        config: Priors and drift rates.
        seams: As for :class:`vgps.gps.drift_model.DriftModel`.
    """
    inside = fixes.used & place(path.t_s, fixes.t_s).inside
    if inside.sum() < 2:
        return FixAssessment.unassessed(len(fixes))
    sigmas_s = {0.0, config.sensors.time_offset_prior_s}  # without and with a time offset
    models = [
        DriftModel(
            path, fixes.where(inside), camera_p_antenna, config.drift, time_offset_sigma_s, seams=seams
        )
        for time_offset_sigma_s in sorted(sigmas_s)
    ]
    within = _assess(models, path, fixes.where(inside), config)
    assessment = FixAssessment.unassessed(len(fixes))
    assessment.nominal[inside], assessment.lower[inside] = within.nominal, within.lower
    return assessment


def _assess(models: list[DriftModel], path: Trajectory, fixes: Fixes, config: Config) -> FixAssessment:
    """Assess fixes at the most likely of several fits.

    The fits start from the given path and from coarse fits to all fixes and to those of the finest class,
    which many coarse ones would outvote; then from fits to all accepted fixes except one suspect run in each
    stretch, then except those runs without which stretches are likelier.
    """
    stretches = Stretches.along(path, fixes, models[0].knots)
    tolerance_m = _tolerance(path, models[0].knots, config)
    everything = np.ones(len(fixes), dtype=bool)
    finest = fixes.fix_class == fixes.fix_class[np.argmin(fixes.r_m)]
    fitted = [everything, finest] if 1 < finest.sum() < len(fixes) else [everything]

    def fits(starts: Callable[[DriftModel], Iterable[FloatArray]]) -> list[_Fit]:
        ends = [(model, start) for model in models for start in starts(model)]
        return [_alternate(model, start, fixes, tolerance_m, config, stretches) for model, start in ends]

    def fits_without(left_out: list[BoolArray]) -> list[_Fit]:
        return fits(
            lambda model: (model.fit_coarse_to_fine(accepted & ~run, tolerance_m) for run in left_out)
        )

    best = _likeliest(
        fits(lambda model: (model.start, *(model.fit_coarse_to_fine(to, tolerance_m) for to in fitted)))
    )
    accepted = ~assess_offsets(best.offset, fixes, config, tolerance_m).rejected
    offset = models[0].offsets(models[0].start)[accepted]
    beyond = _jumps(offset, fixes.where(accepted), tolerance_m, config)
    runs = suspect_runs(beyond, accepted, stretches, config.outliers.max_jumps)
    if left_out := trial_masks(runs, len(fixes)):
        ends = fits_without(left_out)
        energies = np.reshape([end.energy for end in ends], (len(models), len(left_out), -1))
        without = better_without(runs, energies.min(axis=0), best.energy)
        best = _likeliest([best, *ends])
        if len(without) > 1:
            best = _likeliest([best, *fits_without(trial_masks([[run] for run in without], len(fixes)))])
    return assess_offsets(best.offset, fixes, config, tolerance_m)


def _jumps(offset: FloatArray, fixes: Fixes, tolerance_m: float, config: Config) -> FloatArray:
    """Return the changes (N - 1,) of the offset (N, 3) from fix to fix, in regions of what is drawn anew."""
    step, r, h, anew = np.diff(offset, axis=0), fixes.r_m, fixes.h_m, drawn_anew(fixes, config)
    return np.maximum(
        np.hypot(step[:, 0], step[:, 1]) / (anew * (r[1:] + r[:-1]) + tolerance_m),
        np.abs(step[:, 2]) / (anew * (h[1:] + h[:-1]) + tolerance_m),
    )


class _Fit(NamedTuple):
    """Negative log-likelihood (S,) of each stretch up to a constant, and the offsets (M, 3) of the fit."""

    energy: FloatArray
    offset: FloatArray


def _likeliest(fits: list[_Fit]) -> _Fit:
    return min(fits, key=lambda fit: float(fit.energy.sum()))


def _alternate(
    model: DriftModel,
    parameters: FloatArray,
    fixes: Fixes,
    tolerance_m: float,
    config: Config,
    stretches: Stretches,
) -> _Fit:
    """Assess and fit in turn until the verdicts no longer change, and return the likeliest fit.

    That may be the first: each fit takes errors for independent, so that many alike bend the path to them.
    """
    found: list[_Fit] = []
    before = None
    for _ in range(_ROUNDS + 1):
        offset = model.offsets(parameters)
        current, log_likelihood = _assessed(offset, fixes, config, tolerance_m)
        found.append(_Fit(stretches.sums(-log_likelihood, 0.5 * model.prior_costs(parameters)), offset))
        if before is not None and current.agrees_with(before):
            break
        assessed, before = current.applied(fixes), current
        regions = np.stack([assessed.r_m, assessed.r_m, assessed.h_m], axis=1)
        parameters = model.refine(parameters, assessed.used, regions)
    return _likeliest(found)


def _tolerance(path: Trajectory, knots: int, config: Config) -> float:
    """Return the tolerated error of the path between two knots, metres."""
    return max(config.outliers.path_tolerance * path.length_m / knots, 0.01)
