"""Regions r(p) and h(p) of every fix class and how its errors change, from logs with a known truth."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from pathlib import Path

import numpy as np

from vgps.config import SurveyConfig
from vgps.errors import GpsLogError
from vgps.model import FixClass, FloatArray, GeodeticPoint, GpsLog, IntArray
from vgps.readers.gps import read_gps_log
from vgps.survey.errors import CLOCK, ErrorSeries, errors_about, errors_against, mean_of_fixes
from vgps.survey.memory import find_changes, find_stretches, fit_memory
from vgps.survey.regions import ClassSurvey, correlation_time, least_ellipsoid, outside, region


@dataclass(frozen=True, kw_only=True)
class Survey:
    """The result of a survey.

    Attributes:
        truth: Position of the antenna, or the reference log.
        classes: Every class of known quality in the logs, best first.
        t_s: (N,) times of all epochs, from the first one of their log.
        errors_m: (N, 3) fix minus truth, east, north, up.
        fix_class: (N,).
        warnings: What a user should know before relying on it.
    """

    truth: GeodeticPoint | Path
    classes: tuple[ClassSurvey, ...]
    t_s: FloatArray
    errors_m: FloatArray
    fix_class: tuple[FixClass, ...]
    warnings: tuple[str, ...] = field(default=())


def survey_logs(
    paths: Sequence[Path], config: SurveyConfig | None = None, truth: GeodeticPoint | Path | None = None
) -> Survey:
    """Survey a receiver from logs taken at a fixed point, or on drives with a better log.

    Args:
        paths: GPS logs of any known format.
        config: Share to drop and limits.
        truth: Position of the antenna, or a better log of the same antenna, whose RTK-fix epochs are the
            truth; by default the mean of the logs' own RTK-fix epochs.

    Raises:
        GpsLogError: A log cannot be read, there is no truth, or the receiver moved.
    """
    config = config or SurveyConfig()
    if not paths:
        raise GpsLogError("no log given", expected="one or more GPS logs")
    logs = [read_gps_log(path, CLOCK if isinstance(truth, Path) else None) for path in paths]
    truth = truth or mean_of_fixes(logs, config.max_spread_m)
    series = _errors(logs, truth, config.max_spread_m)
    classes = survey_errors(series, config)
    notes = [note for log in logs for note in log.skipped]
    return Survey(
        truth=truth,
        classes=classes,
        t_s=np.concatenate([one.t_s - one.t_s[0] for one in series]),
        errors_m=np.concatenate([one.error_m for one in series]),
        fix_class=tuple(name for one in series for name in one.fix_class),
        warnings=(*notes, *(text for one in classes for text in _warnings(one, config))),
    )


def survey_errors(
    series: Sequence[ErrorSeries], config: SurveyConfig | None = None
) -> tuple[ClassSurvey, ...]:
    """Survey every class of known quality in the errors of one receiver, best first."""
    config = config or SurveyConfig()
    names = np.array([str(name) for one in series for name in one.fix_class])
    stretches = [find_stretches(one.t_s, one.fix_class, config.max_gap_s) for one in series]
    ends = np.cumsum([0, *[1 + stretch[-1] for stretch in stretches]])
    every = _Epochs(
        t_s=np.concatenate([one.t_s for one in series]),
        error_m=np.concatenate([one.error_m for one in series]),
        stretch=np.concatenate([end + stretch for end, stretch in zip(ends, stretches, strict=False)]),
        log=np.repeat(np.arange(len(series)), [len(one.t_s) for one in series]),
    )
    return tuple(
        _survey_class(name, every.rows(names == name), config)
        for name in FixClass
        if name is not FixClass.UNKNOWN and np.any(names == name)
    )


def _errors(logs: Sequence[GpsLog], truth: GeodeticPoint | Path, max_spread_m: float) -> list[ErrorSeries]:
    if isinstance(truth, GeodeticPoint):
        return [errors_about(truth, log) for log in logs]
    reference = read_gps_log(truth, CLOCK)
    return [errors_against(reference, log, max_spread_m) for log in logs]


@dataclass(frozen=True, kw_only=True)
class _Epochs:
    """Times (N,), errors (N, 3), stretches (N,) and logs (N,) of the epochs of one class."""

    t_s: FloatArray
    error_m: FloatArray
    stretch: IntArray
    log: IntArray

    def rows(self, chosen: np.ndarray) -> "_Epochs":
        return _Epochs(**{one.name: getattr(self, one.name)[chosen] for one in fields(self)})


def _survey_class(name: FixClass, epochs: _Epochs, config: SurveyConfig) -> ClassSurvey:
    t_s, own = epochs.t_s, epochs.error_m
    r_m, h_m = region(own, config.drop)
    ellipsoid = least_ellipsoid(own, outside(own, r_m, h_m))
    # correlations end with a log
    ends = np.flatnonzero(np.diff(epochs.log, prepend=-1, append=-1))
    spans = [slice(a, b) for a, b in pairwise(ends)]
    times = [correlation_time(t_s[span], own[span]) for span in spans]
    correlation_s = float(np.average(times, weights=np.diff(ends)))
    step = float(np.median(np.diff(t_s))) if len(own) > 1 else 0.0
    independent = len(own) * min(step / correlation_s, 1.0) if correlation_s > 0.0 else float(len(own) > 0)
    changes = find_changes(t_s, own, epochs.stretch)
    half_frame_s = 0.5 / config.frame_rate
    return ClassSurvey(
        fix_class=name,
        epochs=len(own),
        r_m=r_m + config.speed_m_s * half_frame_s,
        h_m=h_m + config.vertical_speed_m_s * half_frame_s,
        largest_m=region(own, 0.0),
        ellipsoid=ellipsoid,
        correlation_s=correlation_s,
        independent=independent,
        memory=fit_memory(changes) if changes else None,
        changes=len(changes[0].change_m) if changes else 0,
    )


def _warnings(one: ClassSurvey, config: SurveyConfig) -> list[str]:
    found = []
    if one.independent < config.min_independent_epochs:
        found.append(
            f"{one.fix_class}: {one.epochs} epochs count as {one.independent:.0f} independent ones "
            f"(errors are correlated over {one.correlation_s:.0f} s): survey longer, at other hours"
        )
    if one.changes < config.min_independent_epochs:
        found.append(
            f"{one.fix_class}: only {one.changes} epochs follow another of their class: noise, walk and tail "
            "are not known well"
        )
    return found
