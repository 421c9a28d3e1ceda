"""What a report says of a run, as numbers and rows."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray, GpsLog, IntArray
from vgps.solution import FixTable, Solution, Verdict
from vgps.writers.tables import region_ratios

_OUTAGE_INTERVALS = 3.0  # a silence is an outage from so many usual intervals between fixes on,
_OUTAGE_S = 5.0  # and from so many seconds on


@dataclass(frozen=True)
class Doubt:
    """A fix that was not taken at its word; ``t_s`` less the lag, ratios of the residual to its region."""

    t_s: float
    line: int
    fix_class: str
    verdict: Verdict
    ratio_r: float
    ratio_h: float
    probability: float
    reason: str


@dataclass(frozen=True)
class Outage:
    """A stretch of the video in which no fix took part; ``sigma_m`` (3,) the largest deviations in it."""

    begin_s: float
    end_s: float
    way_m: float
    sigma_m: FloatArray


def judged(solution: Solution) -> tuple[GpsLog, FixTable] | None:
    """The log with its verdicts, if the run has both and at least one fix."""
    log, table = solution.gps, solution.fixes
    return (log, table) if log is not None and table is not None and len(log) else None


def verdict_counts(solution: Solution) -> dict[str, dict[Verdict, int]]:
    """How many fixes of each class, best first, got each verdict."""
    found = judged(solution)
    if found is None:
        return {}
    log, table = found
    pairs = Counter(zip(log.fix_class, table.verdict, strict=True))
    order = list(type(log.fix_class[0]))
    classes = sorted(set(log.fix_class), key=order.index)
    return {str(name): {verdict: pairs[name, verdict] for verdict in Verdict} for name in classes}


def doubts(solution: Solution) -> list[Doubt]:
    """Every rejected or down-classed fix, in order of time."""
    found = judged(solution)
    if found is None:
        return []
    log, table = found
    ratio_r, ratio_h = region_ratios(table)
    return [
        Doubt(
            float(solution.fix_times_s[row]),
            int(log.line[row]),
            str(log.fix_class[row]),
            verdict,
            float(ratio_r[row]),
            float(ratio_h[row]),
            float(table.probability[row]),
            table.reason[row],
        )
        for row, verdict in enumerate(table.verdict)
        if verdict in {Verdict.REJECTED, Verdict.DOWN_CLASSED}
    ]


def unused_reasons(solution: Solution) -> list[tuple[str, int]]:
    """Why fixes could not take part, and how many, the most frequent first."""
    found = judged(solution)
    if found is None:
        return []
    reasons = zip(found[1].reason, found[1].verdict, strict=True)
    return Counter(reason for reason, verdict in reasons if verdict is Verdict.NOT_USED).most_common()


def outages(solution: Solution) -> list[Outage]:
    """Stretches without a fix that took part, much longer than the usual time between two fixes."""
    found = judged(solution)
    if found is None or len(solution.t_s) < 2:
        return []
    log, table = found
    t_s, way = solution.t_s, way_m(solution)
    times = solution.fix_times_s[table.used]
    usual = float(np.median(np.diff(log.t_s))) if len(log) > 1 else 0.0
    edges = np.unique(np.clip([t_s[0], *times, t_s[-1]], t_s[0], t_s[-1]))
    long = np.flatnonzero(np.diff(edges) > max(_OUTAGE_INTERVALS * usual, _OUTAGE_S))
    return [_outage(solution, way, float(edges[k]), float(edges[k + 1])) for k in long]


def _outage(solution: Solution, way: FloatArray, begin_s: float, end_s: float) -> Outage:
    inside = solution.sigma_position_m[(solution.t_s >= begin_s) & (solution.t_s <= end_s)]
    known = inside[np.isfinite(inside).all(axis=1)]
    largest = known.max(axis=0) if len(known) else np.full(3, np.nan)
    begin_m, end_m = np.interp([begin_s, end_s], solution.t_s, way)
    return Outage(begin_s, end_s, float(end_m - begin_m), largest)


def features_per_frame(solution: Solution) -> IntArray:
    """(F,) how many landmarks each frame sees."""
    return np.bincount(solution.observations.frame, minlength=len(solution.t_s)).astype(np.int64)


def way_m(solution: Solution) -> FloatArray:
    """(F,) length of the camera's path up to each frame."""
    steps = np.linalg.norm(np.diff(solution.world_T_camera[:, :3, 3], axis=0), axis=1)
    return np.concatenate([np.zeros(min(1, len(solution.t_s))), np.cumsum(steps)])


def antenna_path(solution: Solution) -> FloatArray:
    """(F, 3) the antenna in the world."""
    poses = solution.world_T_camera
    return np.asarray(poses[:, :3, :3] @ solution.camera_p_antenna + poses[:, :3, 3])
