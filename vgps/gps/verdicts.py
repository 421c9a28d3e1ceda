"""One verdict per fix: the antenna's offset from it, whether the fix was used, and the reason."""

from collections.abc import Iterable, Sequence

import numpy as np

from vgps.config import Config
from vgps.gps.antenna_path import antenna_offsets, place
from vgps.gps.fix_conflict import FixConflict
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment
from vgps.model import BoolArray, FixClass, FloatArray, GpsLog, IntArray
from vgps.solution import FixTable, Trajectory, Verdict

SURE = 0.9
"""Probability of a verdict below which it is uncertain."""
_NAMED = 3  # such verdicts that a warning names
_LEAST_FIXES = 10  # of a class, before their share beyond its region says anything
_MOST_BEYOND = 0.5  # a region is to hold 95 %; a receiver that is worse than others may leave half of them
_LEAST_REFUSED = 3  # in a row, and
_LEAST_REFUSED_S = 2.0  # from the first to the last: less is soon over, whoever is right
_WORDS = ("used", "down-classed", "rejected")


def fix_table(
    log: GpsLog,
    fixes: Fixes,
    assessment: FixAssessment,
    trajectory: Trajectory,
    camera_p_antenna: FloatArray,
    config: Config,
) -> FixTable:
    """Return the table behind ``gps.csv``.

    Args:
        log: The fixes as read.
        fixes: The same fixes in the world, with the time offset removed.
        assessment: Assessment of these fixes.
        trajectory: The estimated poses.
        camera_p_antenna: (3,) metres.
        config: Gives the GPS model.
    """
    inside = place(trajectory.t_s, fixes.t_s).inside
    residual = antenna_offsets(fixes, trajectory, camera_p_antenna)
    residual[~inside] = np.nan
    assessed = assessment.applied(fixes)
    by_assessment = verdicts_of(assessment)
    repeats = _repeats_error(residual, fixes, assessment.rejected)
    verdicts, reasons = [], []
    for row, fix_class in enumerate(log.fix_class):
        why_not = _why_not(fix_class, bool(inside[row]), float(fixes.r_m[row]), config)
        if why_not:
            verdicts.append(Verdict.NOT_USED)
            reasons.append(f"not used: {why_not}")
            continue
        verdicts.append(by_assessment[row])
        where = _where(residual[row], float(assessed.r_m[row]), float(assessed.h_m[row]))
        repeated = ", in error as the fix before it" if repeats[row] else ""
        reasons.append(_in_words(verdicts[-1], fix_class, where, assessment, row) + repeated)
    return FixTable(
        world_p_fix=fixes.world_p_fix,
        residual_m=residual,
        r_m=assessed.r_m,
        h_m=assessed.h_m,
        probability=assessment.nominal,
        verdict=tuple(verdicts),
        reason=tuple(reasons),
    )


def _why_not(fix_class: FixClass, inside: bool, r_m: float, config: Config) -> str:
    if np.isnan(r_m):
        return f"class {fix_class} has no region"
    if not inside:
        return "outside the video"
    return "the GPS model is none" if config.gps.model == "none" else ""


def verdicts_of(assessment: FixAssessment) -> list[Verdict]:
    """Return the verdict on each fix (M,), as if all of them contributed."""
    return [
        Verdict.REJECTED if rejected else Verdict.DOWN_CLASSED if down_classed else Verdict.USED
        for rejected, down_classed in zip(assessment.rejected, assessment.down_classed, strict=True)
    ]


def close_calls(
    assessment: FixAssessment, t_s: FloatArray, conflicts: Iterable[FixConflict] = ()
) -> tuple[str, ...]:
    """Return a warning if verdicts are uncertain: which, with their probabilities and the alternatives.

    Args:
        assessment: Assessment of the fixes (M,).
        t_s: (M,) their times.
        conflicts: Of fixes whose verdicts have warnings of their own.
    """
    in_conflict = np.zeros(len(t_s), dtype=bool)
    for conflict in conflicts:
        in_conflict[conflict.right] = in_conflict[conflict.wrong] = True
    nominal, lower = np.nan_to_num(assessment.nominal, nan=1.0), np.nan_to_num(assessment.lower)
    states = np.stack([nominal, lower, 1.0 - nominal - lower])  # in the order of _WORDS
    rows = np.flatnonzero((states.max(axis=0) < SURE) & ~in_conflict)
    if not len(rows):
        return ()
    ranked = np.argsort(-states[:, rows], axis=0)
    named = [
        f"{_WORDS[first]} at {t_s[row]:.1f} s (p = {states[first, row]:.2f}; else {_WORDS[second]})"
        for row, first, second in zip(rows.tolist(), ranked[0].tolist(), ranked[1].tolist(), strict=True)
    ]
    named = named[:_NAMED] + ([f"{len(named) - _NAMED} more"] if len(named) > _NAMED else [])
    return (
        f"uncertain verdicts on fixes: {', '.join(named)}; the poses near them depend on these, "
        "and their sigmas do not cover it: compare with outliers: {enabled: false}",
    )


def contradictions(table: FixTable, fix_class: Sequence[FixClass]) -> tuple[str, ...]:
    """Return a warning for each class whose fixes are mostly not what the class says.

    Distances of down-classed fixes are in regions of the class below. An error that all fixes share, as of
    the height or the datum, moves the path with it and contradicts nothing.

    Args:
        table: Verdicts, residuals and regions of the fixes (M,).
        fix_class: (M,) their classes.
    """
    horizontal = np.hypot(table.residual_m[:, 0], table.residual_m[:, 1]) / table.r_m
    ratio = np.maximum(horizontal, np.abs(table.residual_m[:, 2]) / table.h_m)
    judged = np.array([verdict is not Verdict.NOT_USED for verdict in table.verdict], dtype=bool)
    beyond = judged & ((ratio > 1.0) | [verdict is not Verdict.USED for verdict in table.verdict])
    names, found = np.array(fix_class, dtype=str), []
    for name in np.unique(names).tolist():
        own = names == name
        many, outside = int(np.sum(judged & own)), int(np.sum(beyond & own))
        times = np.median(ratio[beyond & own]) if outside else 0.0
        if many >= _LEAST_FIXES and outside > _MOST_BEYOND * many:
            found.append(
                f"the log contradicts its class {name}: {outside} of {many} fixes are not within the region "
                f"of the class, {times:.1f} times as far in the median; a wrong lever arm or clock would do "
                "that, or a receiver that is worse than its class: see gps.csv, check rig.yaml, or make a "
                "--survey of the receiver"
            )
    return tuple(found)


def are_refused(table: FixTable, fix_class: Sequence[FixClass]) -> BoolArray:
    """Return whether each fix (M,) was refused, as is an RTK-fix that counts as one of the class below."""
    names, verdicts = np.array(fix_class, dtype=str), np.array(table.verdict, dtype=str)
    down_classed = (verdicts == Verdict.DOWN_CLASSED) & (names == FixClass.RTK_FIX)
    return np.asarray((verdicts == Verdict.REJECTED) | down_classed)


def refusals(
    table: FixTable, fix_class: Sequence[FixClass], t_s: FloatArray, conflicts: Iterable[FixConflict] = ()
) -> tuple[str, ...]:
    """Return a warning for each class of which fixes in a row were refused: the video may be wrong instead.

    Args:
        table: Verdicts and residuals of the fixes (M,).
        fix_class: (M,) their classes.
        t_s: (M,) their times.
        conflicts: Of fixes whose verdicts have warnings of their own.
    """
    names, verdicts = np.array(fix_class, dtype=str), np.array(table.verdict, dtype=str)
    refused = are_refused(table, fix_class)
    for conflict in conflicts:
        refused[conflict.wrong] = False
    found = []
    for name in np.unique(names).tolist():
        rows = np.flatnonzero((names == name) & (verdicts != Verdict.NOT_USED))
        ends = np.flatnonzero(np.diff(refused[rows])) + 1
        runs = [run for run in np.split(rows, ends) if refused[run].any()]
        long = [run for run in runs if len(run) >= _LEAST_REFUSED and np.ptp(t_s[run]) >= _LEAST_REFUSED_S]
        if long:
            found.append(_refusal(name, long, t_s, table.residual_m))
    return tuple(found)


def _refusal(name: str, runs: Sequence[IntArray], t_s: FloatArray, residual_m: FloatArray) -> str:
    stretches = [
        f"{len(run)} from {t_s[run[0]]:.1f} to {t_s[run[-1]]:.1f} s "
        f"({np.median(np.hypot(*residual_m[run, :2].T)):.2f} m in the plane, "
        f"{np.median(np.abs(residual_m[run, 2])):.2f} m in height)"
        for run in runs
    ]
    stretches = stretches[:_NAMED] + ([f"{len(runs) - _NAMED} more stretches"] if len(runs) > _NAMED else [])
    return (
        f"fixes of class {name} in a row were refused, by the video and the other fixes: "
        f"{', '.join(stretches)}. If the receiver was right there, the video went astray, and poses and "
        "standard deviations are wrong: see what it shows there, and compare with outliers: {enabled: false}"
    )


def _repeats_error(residual: FloatArray, fixes: Fixes, rejected: BoolArray) -> BoolArray:
    """Return whether each fix (M,) and the one before it are rejected with the same error."""
    step, r, h = np.diff(residual, axis=0), fixes.r_m, fixes.h_m
    with np.errstate(invalid="ignore"):  # NaN without a residual or a region
        near = (np.hypot(step[:, 0], step[:, 1]) <= r[1:] + r[:-1]) & (np.abs(step[:, 2]) <= h[1:] + h[:-1])
    return np.append(False, near & rejected[1:] & rejected[:-1])


def _where(residual: FloatArray, r_m: float, h_m: float) -> str:
    horizontal, vertical = float(np.hypot(residual[0], residual[1])) / r_m, abs(float(residual[2])) / h_m
    if horizontal <= 1.0 and vertical <= 1.0:
        return "the antenna lies in its region"
    return f"the antenna lies outside its region, {horizontal:.1f} r and {vertical:.1f} h away"


def _in_words(verdict: Verdict, fix_class: FixClass, where: str, assessment: FixAssessment, row: int) -> str:
    nominal, lower = assessment.nominal[row], assessment.lower[row]
    if verdict == Verdict.REJECTED:
        outlier = 1 - nominal - lower
        return f"rejected: {where}, by the video and the other fixes; an outlier with p = {outlier:.4f}"
    if verdict == Verdict.DOWN_CLASSED:
        return f"down-classed: not as good as {fix_class} says, p = {lower:.4f}; in the class below {where}"
    return f"used: {where}"
