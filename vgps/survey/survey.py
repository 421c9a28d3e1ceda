"""Regions r(p) and h(p) of every fix class, from logs of a receiver at a fixed point."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from vgps.config import SurveyConfig
from vgps.errors import GpsLogError
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import FixClass, FloatArray, GeodeticPoint, GpsLog
from vgps.readers.gps import read_gps_log
from vgps.survey.regions import ClassSurvey, correlation_time, least_ellipsoid, outside, region


@dataclass(frozen=True, kw_only=True)
class Survey:
    """The result of a survey.

    Attributes:
        truth: Position of the antenna.
        classes: Every class of known quality in the logs, best first.
        t_s: (N,) times of all epochs, from the first fix of their log.
        errors_m: (N, 3) fix minus truth, east, north, up.
        fix_class: (N,).
        warnings: What a user should know before relying on it.
    """

    truth: GeodeticPoint
    classes: tuple[ClassSurvey, ...]
    t_s: FloatArray
    errors_m: FloatArray
    fix_class: tuple[FixClass, ...]
    warnings: tuple[str, ...] = field(default=())


def survey_logs(
    paths: Sequence[Path], config: SurveyConfig | None = None, truth: GeodeticPoint | None = None
) -> Survey:
    """Survey a receiver from logs taken at a fixed point.

    Args:
        paths: GPS logs of any known format.
        config: Share to drop and limits.
        truth: Position of the antenna; by default the mean of the RTK-fix epochs.

    Raises:
        GpsLogError: A log cannot be read, there is no truth, or the receiver moved.
    """
    config = config or SurveyConfig()
    logs = [read_gps_log(path) for path in paths]
    if not logs:
        raise GpsLogError("no log given", expected="one or more GPS logs of a standing receiver")
    classes = tuple(name for log in logs for name in log.fix_class)
    truth = truth or _mean_of_fixes(logs, config.max_spread_m)
    errors = np.concatenate(
        [to_enu(truth, log.latitude_deg, log.longitude_deg, log.height_m) for log in logs]
    )
    t_s = np.concatenate([log.t_s for log in logs])
    starts = np.cumsum([0, *[len(log) for log in logs]])
    found, warnings = [], [note for log in logs for note in log.skipped]
    for name in FixClass:
        rows = np.array([other == name for other in classes])
        if name is FixClass.UNKNOWN or not rows.any():
            continue
        surveyed = _survey_class(name, rows, t_s, errors, starts, config)
        found.append(surveyed)
        if surveyed.independent < config.min_independent_epochs:
            warnings.append(
                f"{name}: {surveyed.epochs} epochs count as {surveyed.independent:.0f} independent ones "
                f"(errors are correlated over {surveyed.correlation_s:.0f} s): survey longer, at other hours"
            )
    return Survey(
        truth=truth,
        classes=tuple(found),
        t_s=t_s,
        errors_m=errors,
        fix_class=classes,
        warnings=tuple(warnings),
    )


def _mean_of_fixes(logs: Sequence[GpsLog], max_spread_m: float) -> GeodeticPoint:
    rows = [np.array([name is FixClass.RTK_FIX for name in log.fix_class]) for log in logs]
    if not any(row.any() for row in rows):
        raise GpsLogError(
            "no RTK-fix epoch, so that the antenna's position is unknown",
            file=logs[0].source,
            remedy="give its position with --truth LATITUDE,LONGITUDE,HEIGHT",
        )
    place = np.concatenate(
        [
            np.stack([log.latitude_deg, log.longitude_deg, log.height_m], 1)[row]
            for log, row in zip(logs, rows, strict=True)
        ]
    )
    # the mean is in metres, since degrees have none at the date line
    origin = GeodeticPoint(*(float(x) for x in place[0]))
    local = to_enu(origin, *place.T)
    mean = local.mean(axis=0)
    spread = float(np.median(np.linalg.norm(local - mean, axis=1)))
    if spread > max_spread_m:
        raise GpsLogError(
            f"half of the RTK-fix epochs are more than {spread:.1f} m from their mean: the receiver moved",
            file=logs[0].source,
            expected=f"at most {max_spread_m:g} m, as of a standing receiver",
            remedy="cut the log to the time when it stood still, or give --truth",
        )
    return GeodeticPoint(*(float(x) for x in to_geodetic(origin, mean)))


def _survey_class(
    name: FixClass,
    rows: np.ndarray,
    t_s: FloatArray,
    errors: FloatArray,
    starts: np.ndarray,
    config: SurveyConfig,
) -> ClassSurvey:
    own = errors[rows]
    r_m, h_m = region(own, config.drop)
    ellipsoid = least_ellipsoid(own, outside(own, r_m, h_m))
    # correlations end with a log
    times = [correlation_time(t_s[a:b][rows[a:b]], errors[a:b][rows[a:b]]) for a, b in pairwise(starts)]
    weights = [int(rows[a:b].sum()) for a, b in pairwise(starts)]
    correlation_s = float(np.average(times, weights=weights))
    step = float(np.median(np.diff(t_s[rows]))) if len(own) > 1 else 0.0
    independent = len(own) * min(step / correlation_s, 1.0) if correlation_s > 0.0 else float(len(own) > 0)
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
    )
