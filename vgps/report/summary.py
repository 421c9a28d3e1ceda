"""What a report states about a run, as numbers and rows."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from vgps.geometry import travelled
from vgps.model import FloatArray, IntArray
from vgps.solution import Solution, Verdict

_OUTAGE_INTERVALS = 3.0  # a gap is an outage if it exceeds this many usual intervals between fixes
_OUTAGE_S = 5.0  # and this many seconds


@dataclass(frozen=True, kw_only=True)
class DoubtedFix:
    """A rejected or down-classed fix; time less the time offset, residual as ratios to r and h."""

    t_s: float
    line: int
    fix_class: str
    verdict: Verdict
    ratio_r: float
    ratio_h: float
    probability: float
    reason: str


@dataclass(frozen=True, kw_only=True)
class Outage:
    """A part of the video without used fixes; ``sigma_m`` (3,) are the largest in it, east, north, up."""

    begin_s: float
    end_s: float
    distance_m: float
    sigma_m: FloatArray


def verdict_counts(solution: Solution) -> dict[str, dict[Verdict, int]]:
    """Count the verdicts on the fixes of each class, best class first."""
    if solution.judged_fixes is None:
        return {}
    log, table = solution.judged_fixes
    pairs = Counter(zip(log.fix_class, table.verdict, strict=True))
    order = list(type(log.fix_class[0]))
    classes = sorted(set(log.fix_class), key=order.index)
    return {str(name): {verdict: pairs[name, verdict] for verdict in Verdict} for name in classes}


def doubted_fixes(solution: Solution) -> list[DoubtedFix]:
    """Return all rejected and down-classed fixes in order of time."""
    if solution.judged_fixes is None:
        return []
    log, table = solution.judged_fixes
    ratio_r, ratio_h = table.region_ratios
    return [
        DoubtedFix(
            t_s=float(solution.fix_times_s[row]),
            line=int(log.line[row]),
            fix_class=str(log.fix_class[row]),
            verdict=verdict,
            ratio_r=float(ratio_r[row]),
            ratio_h=float(ratio_h[row]),
            probability=float(table.probability[row]),
            reason=table.reason[row].removeprefix(f"{verdict}: "),
        )
        for row, verdict in enumerate(table.verdict)
        if verdict in {Verdict.REJECTED, Verdict.DOWN_CLASSED}
    ]


def unused_reasons(solution: Solution) -> list[tuple[str, int]]:
    """Count the reasons why fixes were not used, most frequent first."""
    table = solution.fixes
    if table is None:
        return []
    reasons = zip(table.reason, table.verdict, strict=True)
    unused = (
        reason.removeprefix(f"{verdict}: ") for reason, verdict in reasons if verdict is Verdict.NOT_USED
    )
    return Counter(unused).most_common()


def outages(solution: Solution) -> list[Outage]:
    """Return the gaps between used fixes that are much longer than the usual interval."""
    if solution.judged_fixes is None or len(solution.t_s) < 2:
        return []
    log, table = solution.judged_fixes
    t_s, distance = solution.t_s, distance_m(solution)
    times = solution.fix_times_s[table.used]
    interval_s = float(np.median(np.diff(log.t_s))) if len(log) > 1 else 0.0
    edges = np.unique(np.clip([t_s[0], *times, t_s[-1]], t_s[0], t_s[-1]))
    gaps = np.flatnonzero(np.diff(edges) > max(_OUTAGE_INTERVALS * interval_s, _OUTAGE_S))
    return [_outage(solution, distance, float(edges[k]), float(edges[k + 1])) for k in gaps]


def _outage(solution: Solution, distance: FloatArray, begin_s: float, end_s: float) -> Outage:
    inside = solution.sigma_position_m[(solution.t_s >= begin_s) & (solution.t_s <= end_s)]
    known = inside[np.isfinite(inside).all(axis=1)]
    largest = known.max(axis=0) if len(known) else np.full(3, np.nan)
    begin_m, end_m = np.interp([begin_s, end_s], solution.t_s, distance)
    return Outage(begin_s=begin_s, end_s=end_s, distance_m=float(end_m - begin_m), sigma_m=largest)


def features_per_frame(solution: Solution) -> IntArray:
    """Return (F,) the number of observations in each frame."""
    _, observations = solution.all_landmarks
    return np.bincount(observations.frame, minlength=len(solution.t_s)).astype(np.int64)


def distance_m(solution: Solution) -> FloatArray:
    """Return (F,) the distance along the camera's path up to each frame."""
    return travelled(solution.world_T_camera[:, :3, 3])


def antenna_positions(solution: Solution) -> FloatArray:
    """Return (F, 3) the antenna in the world."""
    poses = solution.world_T_camera
    return np.asarray(poses[:, :3, :3] @ solution.camera_p_antenna + poses[:, :3, 3])
