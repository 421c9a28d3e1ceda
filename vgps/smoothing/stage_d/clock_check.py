"""Do the poses of stage D show the time offset between GPS and video?

Displacements between fixes show it where the path turns or brakes (:mod:`vgps.gps.time_offset`). Places of
RTK-fixes show it as well, and better: an offset that walks by centimetres does not explain them. Those of
coarse fixes say little and depend on how the video drifts, so the first round decides, which takes their
errors as large as any receiver's. Where neither shows one, none is assumed, and the standard deviations of
the poses cover what that may be wrong by.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from vgps.config import SensorsConfig
from vgps.errors import GeometryError
from vgps.gps.fixes import CLASSES
from vgps.gps.sensors import TIME_OFFSET, Sensors, TimeOffset
from vgps.gps.time_offset import model_average, without_prior
from vgps.model import FixClass
from vgps.smoothing.stage_d.batch_result import BatchSolution
from vgps.smoothing.stage_d.sensor_steps import least_cost_step

# Standard deviations from the configured time offset that make a trial worth while. Poses that were held to
# it have bent to the fixes, and suggest a part of what a trial finds; whether that is chance is decided then.
_SUSPECT = 1.0


def with_shown_clock(
    sensors: Sensors, solved: BatchSolution, solve: Callable[[Sensors], BatchSolution]
) -> tuple[Sensors, BatchSolution]:
    """Return the sensors with the verdict whether the poses determine the time offset, and the first round.

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
    shown_before = sensors.prior_time_offset.sigma_s > 0.0
    if shown_before and sensors.probability == 1.0:
        good = solved.given.fixes.fix_class[used] == CLASSES.index(FixClass.RTK_FIX)
        return replace(sensors, shown_by_poses=bool(np.mean(good) > 0.5)), solved
    prior, held_sigma_s = TimeOffset.from_config(settings), 0.0
    try:
        shown = _shown(solved, prior)
        if (accepted := _tried(sensors, shown, settings, solve)) is not None:
            return accepted
        held_sigma_s = _held_sigma(shown, prior, settings.trusted_time_offset_s)
    except (GeometryError, np.linalg.LinAlgError):  # said with the standard deviations of the poses
        pass
    if not shown_before:
        return replace(sensors, held_sigma_s=held_sigma_s), solved
    held = sensors.with_time_offset(TimeOffset(prior.time_offset_s, 0.0))
    return replace(held, held_sigma_s=held_sigma_s), solve(held)


def _held_sigma(shown: TimeOffset, prior: TimeOffset, trusted_s: float) -> float:
    """Return the root mean square error of the prior's mean: clocks agree, or any time offset is as likely.

    Args:
        shown: That of the poses, under the prior.
        prior: Any time offset.
        trusted_s: To which clocks agree where nothing is wrong.
    """
    _, probability = model_average(without_prior(shown, prior), prior, trusted_s)
    error_s = float(np.hypot(shown.sigma_s, shown.time_offset_s - prior.time_offset_s))
    return float(np.sqrt(probability)) * error_s


def _tried(
    sensors: Sensors, shown: TimeOffset, settings: SensorsConfig, solve: Callable[[Sensors], BatchSolution]
) -> tuple[Sensors, BatchSolution] | None:
    """Return the round with a time offset that may be chance; None if there is none, or if it is."""
    prior = TimeOffset.from_config(settings)
    start, before = sensors.prior_time_offset, sensors.probability
    if not start.sigma_s:
        start, before = shown, 0.5
        chance_s = float(np.hypot(settings.trusted_time_offset_s, start.sigma_s))
        if abs(start.time_offset_s - prior.time_offset_s) < _SUSPECT * chance_s:
            return None
    trial = replace(sensors.with_time_offset(start), prior_time_offset=prior, shown_by_poses=True)
    tried = solve(trial)
    found = _shown(tried, prior)
    _, probability = model_average(found, prior, settings.trusted_time_offset_s)
    likelier = probability * before >= (1.0 - probability) * (1.0 - before)
    return (trial, tried) if likelier and _same_side(start, found, prior) else None


def _same_side(suspected: TimeOffset, found: TimeOffset, prior: TimeOffset) -> bool:
    """Return whether both time offsets are to the same side of the configured one."""
    before, after = (one.time_offset_s - prior.time_offset_s for one in (suspected, found))
    return before * after > 0.0


def _shown(solved: BatchSolution, prior: TimeOffset) -> TimeOffset:
    """Return the time offset of the least cost, poses adapting, with its standard deviation."""
    given, end = solved.given, solved.result.problem
    sensors = replace(given.sensors, prior_time_offset=prior)
    step, covariance = least_cost_step(given, end, sensors, TIME_OFFSET)
    found = sensors.moved({**sensors.shared(), **end.shared})
    return TimeOffset(found.time_offset_s + float(step[0]), float(np.sqrt(covariance[0, 0])))
