"""Do the poses of stage D show the time offset between GPS and video?

Displacements between fixes show it where the path turns or brakes (:mod:`vgps.gps.time_offset`). Places of
RTK-fixes show it as well, and better: an offset that walks by centimetres does not explain them. Those of
coarse fixes say little and depend on how the video drifts, so the first round decides, which takes their
errors as large as any receiver's.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vgps.errors import GeometryError
from vgps.gps.fixes import CLASSES
from vgps.gps.sensors import TIME_OFFSET, Sensors, TimeOffset
from vgps.gps.time_offset import weighed
from vgps.model import FixClass
from vgps.smoothing.batch_result import BatchSolution
from vgps.smoothing.sensor_steps import better_sensors

_SUSPECT = 2.0  # standard deviations from the configured time offset that make a trial worth while


def with_shown_clock(
    sensors: Sensors, solved: BatchSolution, solve: Callable[[Sensors], BatchSolution]
) -> tuple[Sensors, BatchSolution]:
    """Return whether the poses tell the time offset, and the first round with it.

    What displacements have shown they improve if most fixes are RTK-fixes. Where that might be chance, or the
    places of the fixes suggest a time offset, the round is solved again with it to estimate, and counts if it
    is likelier than none and to the side that was suspected.

    Args:
        sensors: Before the round.
        solved: The round, with the time offset held.
        solve: Solves it with other sensors.
    """
    config = solved.given.context.config
    settings, used = config.sensors, solved.given.fixes.used
    if not (settings.time_offset_prior_s and config.gps.has_memory and used.any()):
        return sensors, solved
    likely = sensors.prior_time_offset
    if likely.sigma_s and sensors.probability == 1.0:
        good = solved.given.fixes.fix_class[used] == CLASSES.index(FixClass.RTK_FIX)
        return replace(sensors, poses_tell=bool(np.median(good))), solved
    prior = TimeOffset(settings.time_offset_s, settings.time_offset_prior_s)
    try:
        shown = _shown(solved, prior)
        chance_s = float(np.hypot(settings.trusted_time_offset_s, shown.sigma_s))
        if not likely.sigma_s and abs(shown.time_offset_s - prior.time_offset_s) < _SUSPECT * chance_s:
            return sensors, solved
        start = likely if likely.sigma_s else shown
        trial = replace(sensors.with_time_offset(start), prior_time_offset=prior, poses_tell=True)
        tried = solve(trial)
        found = _shown(tried, prior)
    except (GeometryError, np.linalg.LinAlgError):  # said with the standard deviations of the poses
        return sensors, solved
    before = sensors.probability if likely.sigma_s else 0.5
    _, probability = weighed(found, prior, settings.trusted_time_offset_s)
    likelier = probability * before >= (1.0 - probability) * (1.0 - before)
    if likelier and _same_way(start, found, prior):
        return trial, tried
    held = sensors.with_time_offset(replace(prior, sigma_s=0.0))
    return held, solve(held) if likely.sigma_s else solved


def _same_way(suspected: TimeOffset, found: TimeOffset, prior: TimeOffset) -> bool:
    """Return whether both time offsets are to the same side of the configured one."""
    before, after = (one.time_offset_s - prior.time_offset_s for one in (suspected, found))
    return before * after > 0.0


def _shown(solved: BatchSolution, prior: TimeOffset) -> TimeOffset:
    """Return the time offset of the least cost, poses adapting, with its standard deviation."""
    given, end = solved.given, solved.result.problem
    sensors = replace(given.sensors, prior_time_offset=prior)
    step, covariance = better_sensors(given, end, sensors, TIME_OFFSET)
    found = sensors.moved({**sensors.shared(), **end.shared})
    return TimeOffset(found.time_offset_s + float(step[0]), float(np.sqrt(covariance[0, 0])))
