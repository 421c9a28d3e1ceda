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

from vgps.config import Config, SensorsConfig
from vgps.errors import GeometryError
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.sensors import TIME_OFFSET, Sensors, TimeOffset
from vgps.gps.time_offset import (
    agree_exactly,
    agreed_time_offset,
    model_average,
    with_prior,
    without_prior,
)
from vgps.model import FixClass
from vgps.smoothing.stage_d.batch_result import BatchSolution
from vgps.smoothing.stage_d.sensor_steps import least_cost_step

# Standard deviations from the configured time offset that make a trial worth while. Poses that were held to
# it have bent to the fixes, and suggest a part of what a trial finds; whether that is chance is decided then.
_SUSPECT = 1.0
_PART = 0.5  # at least: they suggested 0.8 to 1.1 times what seven trials found, 0.5 on a gentle drive
_MOSTLY = 0.5  # of the fixes
_DOUBTED = 2.0  # times less is left open by the poses than by displacements: is that so?
_END_SIGMAS = 2.0  # of what displacements leave open, where the poses are asked


def with_shown_clock(
    sensors: Sensors, solved: BatchSolution, solve: Callable[[Sensors], BatchSolution]
) -> tuple[Sensors, BatchSolution]:
    """Return the sensors with the verdict whether the poses determine the time offset, and the first round.

    Poses improve what displacements have shown, by the places of RTK-fixes. If most fixes are RTK-fixes, they
    compare these displacements again, so that what was shown is where they start, but no prior. If most are
    coarse, it is the prior: later rounds, which learn how coarse fixes walk, take a walk along the path for a
    time offset. If all are, it is held.

    Where it might be chance, or the places of the fixes suggest a time offset, the round is solved again with
    it to estimate. It counts if poses and displacements together make it likelier than none, if it is to the
    side that was suspected, and if displacements do not refute it; and it is held from then on unless most
    fixes are RTK-fixes.

    Where neither shows one, poses that claim to know it better than displacements do are asked at both ends
    of what those leave open: what a solution there costs more decides how much is unknown.

    Where none is assumed, but clocks that agree do not do so exactly, what they differ by is estimated with
    the poses, unless these make exact ones likelier again.

    Args:
        sensors: Before the round.
        solved: The round, with the time offset held.
        solve: Solves it with other sensors.
    """
    settings = solved.given.context.config.sensors
    if _agree_exactly(sensors, solved):
        exact = sensors.with_time_offset(TimeOffset(settings.time_offset_s, 0.0))
        sensors, solved = replace(exact, agreed=None), solve(exact)
    agreed, prior = sensors.agreed, agreed_time_offset(settings)
    if agreed is None:
        return _decided(sensors, solved, solve)
    doubted = sensors.holding_time_offset() if sensors.prior_time_offset == agreed else sensors
    decided, solved = _decided(doubted, solved, solve)
    if decided.prior_time_offset.sigma_s:
        return decided, solved
    # poses of RTK-fixes compare what displacements have shown again
    kept = prior if _rtk_fix_share(solved.given.fixes) > _MOSTLY else agreed
    unknown_s = decided.held_sigma_s if decided.held_sigma_s > prior.sigma_s else 0.0
    return replace(decided, prior_time_offset=kept, shown_by_poses=True, held_sigma_s=unknown_s), solved


def _agree_exactly(sensors: Sensors, solved: BatchSolution) -> bool:
    """Return whether poses make clocks that agree exactly likelier, against what displacements said."""
    config = solved.given.context.config
    if sensors.agreed is None or sensors.prior_time_offset != sensors.agreed:
        return False
    if config.sensors.frame_time_sigma_s or not (config.gps.has_memory and solved.given.fixes.used.any()):
        return False
    prior = TimeOffset.from_config(config.sensors)
    try:
        return agree_exactly(without_prior(_shown(solved, prior), prior), config.sensors)
    except (GeometryError, np.linalg.LinAlgError):
        return False


def _decided(
    sensors: Sensors, solved: BatchSolution, solve: Callable[[Sensors], BatchSolution]
) -> tuple[Sensors, BatchSolution]:
    """Return what :func:`with_shown_clock` does of clocks that agree exactly, or not at all."""
    config = solved.given.context.config
    settings, used = config.sensors, solved.given.fixes.used
    if not (settings.time_offset_prior_s and config.gps.has_memory and used.any()):
        return sensors, solved
    shown_before = sensors.prior_time_offset.sigma_s > 0.0
    prior, held_sigma_s = TimeOffset.from_config(settings), 0.0
    if shown_before and sensors.probability == 1.0:
        return with_certain_clock(sensors, solved.given.fixes, config), solved
    try:
        shown = _shown(solved, prior)
        if (accepted := _tried(sensors, shown, settings, solve)) is not None:
            return accepted
        held_sigma_s = _left_unknown(sensors, solved, shown, solve)
    except (GeometryError, np.linalg.LinAlgError):  # said with the standard deviations of the poses
        pass
    if not shown_before:
        return replace(sensors, held_sigma_s=held_sigma_s), solved
    held = sensors.with_time_offset(TimeOffset((sensors.agreed or prior).time_offset_s, 0.0))
    return replace(held, held_sigma_s=held_sigma_s), solve(held)


def with_certain_clock(sensors: Sensors, fixes: Fixes, config: Config) -> Sensors:
    """Return sensors with a time offset that displacements show beyond doubt, for poses to improve.

    So they do in rough solutions, too: a calibration that is refined while a time offset is held suits that.
    """
    shown = sensors.prior_time_offset
    certain = shown.sigma_s > 0.0 and shown != sensors.agreed and sensors.probability == 1.0
    if not (certain and config.gps.has_memory and fixes.used.any()):
        return sensors
    share = _rtk_fix_share(fixes)
    kept = TimeOffset.from_config(config.sensors) if share > _MOSTLY else sensors.prior_time_offset
    return replace(sensors, prior_time_offset=kept, shown_by_poses=share > 0.0)


def _rtk_fix_share(fixes: Fixes) -> float:
    """Return the share of RTK-fixes among those that count."""
    return float(np.mean(fixes.fix_class[fixes.used] == CLASSES.index(FixClass.RTK_FIX)))


def _held_sigma(shown: TimeOffset, settings: SensorsConfig) -> float:
    """Return the root mean square error of the prior's mean: clocks agree, or any time offset is as likely.

    Args:
        shown: Under the prior, which is any time offset.
        settings: The prior, and to what clocks agree where nothing is wrong.
    """
    prior = TimeOffset.from_config(settings)
    _, probability = model_average(without_prior(shown, prior), prior, settings.trusted_time_offset_s)
    error_s = float(np.hypot(shown.sigma_s, shown.time_offset_s - prior.time_offset_s))
    return float(np.sqrt(probability)) * error_s


def _left_unknown(
    sensors: Sensors, solved: BatchSolution, shown: TimeOffset, solve: Callable[[Sensors], BatchSolution]
) -> float:
    """Return the root mean square error of a time offset that is held.

    The standard deviation that poses show is of a small change. A bob or a shake between fixes fits at other
    time offsets nearly as well, and tells them apart no more where they are further than its period. So poses
    are no surer than what both ends of what displacements leave open cost more. An end that costs less is no
    time offset to try: rounds end early, and their costs scatter.

    Args:
        sensors, solved, solve: As for :func:`with_shown_clock`.
        shown: By the poses.
    """
    settings = solved.given.context.config.sensors
    held_sigma_s, open_s = _held_sigma(shown, settings), _left_open(sensors, solved, settings)
    if open_s <= _DOUBTED * held_sigma_s:
        return held_sigma_s
    away_s = _END_SIGMAS * open_s
    ends_s = shown.time_offset_s - away_s, shown.time_offset_s + away_s
    try:
        costs = [_cost(solve(sensors.with_time_offset(TimeOffset(end_s, 0.0)))) for end_s in ends_s]
    except GeometryError:  # no solution confirms what the poses claim
        return open_s
    more = min(costs) - _cost(solved)
    if more <= 0.0:
        return open_s
    sigma_s = max(shown.sigma_s, float(away_s / np.sqrt(2.0 * more)))
    return min(open_s, _held_sigma(replace(shown, sigma_s=sigma_s), settings))


def _left_open(sensors: Sensors, solved: BatchSolution, settings: SensorsConfig) -> float:
    """Return what displacements leave open of a held time offset; 0 if its effect is within all regions."""
    if sensors.by_displacements is None:
        return 0.0
    path, fixes = solved.given.scene.trajectory, solved.given.fixes
    open_s = _held_sigma(sensors.by_displacements, settings)
    counts = open_s * path.length_m > fixes.r_m[fixes.used].min() * np.ptp(path.t_s)
    return open_s if counts else 0.0


def _cost(solved: BatchSolution) -> float:
    return sum(solved.result.report.cost_after.values())


def _tried(
    sensors: Sensors, shown: TimeOffset, settings: SensorsConfig, solve: Callable[[Sensors], BatchSolution]
) -> tuple[Sensors, BatchSolution] | None:
    """Return the round with a time offset that may be chance; None if there is none, or if it is."""
    start, before = sensors.prior_time_offset, sensors.probability
    if not start.sigma_s:
        if not _is_worth_a_trial(sensors, shown, settings):
            return None
        start, before = shown, 0.5
    prior = TimeOffset.from_config(settings)
    trial = replace(sensors.with_time_offset(start), prior_time_offset=prior, shown_by_poses=True)
    tried = solve(trial)
    found = _shown(tried, prior)
    # where displacements made it likely themselves, they count by that probability
    told = found if sensors.prior_time_offset.sigma_s else _both(found, sensors.by_displacements, prior)
    _, probability = model_average(told, prior, settings.trusted_time_offset_s)
    likely, chance = probability * before, (1.0 - probability) * (1.0 - before)
    if not (likely >= chance and _same_side(start, found, prior)):
        return None
    # what is left of the prior is no finding
    unclear = found.sigma_s > settings.time_offset.shown_share * prior.sigma_s
    if unclear or _contradicts(sensors.by_displacements, found, settings):
        return None
    if _rtk_fix_share(tried.given.fixes) > _MOSTLY:
        return trial, tried
    # the end of this round moves it as the trial did
    moved_s = trial.moved(tried.result.problem.shared).time_offset_s - trial.time_offset_s
    held = sensors.with_time_offset(found, likely / (likely + chance))
    return replace(held, time_offset_s=found.time_offset_s - moved_s), tried


def _is_worth_a_trial(sensors: Sensors, shown: TimeOffset, settings: SensorsConfig) -> bool:
    """Return whether a trial may find a time offset that counts, by what poses suggest before it."""
    prior, trusted_s = TimeOffset.from_config(settings), settings.trusted_time_offset_s
    away_s = shown.time_offset_s - prior.time_offset_s
    if abs(away_s) < _SUSPECT * np.hypot(trusted_s, shown.sigma_s):
        return False
    most = replace(shown, time_offset_s=prior.time_offset_s + away_s / _PART)
    _, probability = model_average(_both(most, sensors.by_displacements, prior), prior, trusted_s)
    return probability >= 0.5


def _both(found: TimeOffset, by_displacements: TimeOffset | None, prior: TimeOffset) -> TimeOffset:
    """Return what poses and displacements say together without the prior, under which both are given."""
    by_poses = without_prior(found, prior)
    if by_displacements is None:
        return by_poses
    return with_prior(by_poses, without_prior(by_displacements, prior))


def _same_side(suspected: TimeOffset, found: TimeOffset, prior: TimeOffset) -> bool:
    """Return whether both time offsets are to the same side of the configured one."""
    before, after = (one.time_offset_s - prior.time_offset_s for one in (suspected, found))
    return before * after > 0.0


def _contradicts(by_displacements: TimeOffset | None, found: TimeOffset, settings: SensorsConfig) -> bool:
    """Return whether displacements know that the time offset is another one than the poses found."""
    if by_displacements is None:
        return False
    sigma_s = float(np.hypot(by_displacements.sigma_s, found.sigma_s))
    apart_s = abs(by_displacements.time_offset_s - found.time_offset_s)
    return apart_s > settings.significance_sigmas * sigma_s


def _shown(solved: BatchSolution, prior: TimeOffset) -> TimeOffset:
    """Return the time offset of the least cost, poses adapting, with its standard deviation."""
    given, end = solved.given, solved.result.problem
    sensors = replace(given.sensors, prior_time_offset=prior)
    step, covariance = least_cost_step(given, end, sensors, TIME_OFFSET)
    found = sensors.moved({**sensors.shared(), **end.shared})
    return TimeOffset(found.time_offset_s + float(step[0]), float(np.sqrt(covariance[0, 0])))
