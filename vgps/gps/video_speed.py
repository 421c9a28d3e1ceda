"""A video that plays faster or slower than time passes, found by the shape of its path.

A time-lapse shows minutes in seconds, slow motion seconds in minutes. As :mod:`vgps.gps.clock_search` does at
every time offset, displacements between fixes are compared with the camera's at every speed, near the known
time offset. Turns and stops tell the speed; a straight at constant speed has none.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vgps.config import SensorsConfig
from vgps.gps.clock_misfit import MIN_PAIRS, Misfit, misfit_at, seen_antenna
from vgps.gps.clock_search import REACH_S
from vgps.gps.fixes import Fixes
from vgps.gps.time_offset import compared_fixes
from vgps.model import FloatArray
from vgps.solution import Trajectory

EXPLAINED_SHARE = 0.1  # of the motion that may be left of fixes which a path explains
_SLOWEST, _FASTEST = 1.0 / 32.0, 256.0  # 960 frames a second played at 30; a frame every 8 s
_STEP = 0.04  # in the logarithm of the speed, at most
_SHIFT_S = 1.6  # of the last frame by a step, at most: about as long as a turn
_OFFSET_STEP_S = 0.25
_FINE: FloatArray = 0.1 * np.arange(-10.0, 11.0)  # steps
_APART = 0.2  # in the logarithm: speeds that must not explain the fixes as well
_LONG_S = 600.0  # of a video, whose speeds are not compared at time offsets of a minute: that takes minutes
_COMPARED = 12  # speeds, the best among their neighbours
USUAL_SIGMA = 5e-4  # relative: half of what 29.97 frames a second, taken for 30, are off
_STRONG = 10.0  # evidence (Jeffreys)
_MIN_DOUBTFUL_PAIRS = 10  # of fixes: fewer have the shape of some part of a path by chance


class ShownSpeed(NamedTuple):
    """A speed of a video that explains the fixes.

    Attributes:
        speed: Seconds that pass in a second of the video.
        is_certain: Whether no other one explains them nearly as well.
        time_offset_s: Of the fixes at that speed, perhaps beyond the search about the configured one.
    """

    speed: float
    is_certain: bool
    time_offset_s: float


class _Speed(NamedTuple):
    """A speed by its logarithm, its best time offset, and what these leave of the fixes' displacements."""

    log: float
    offset_s: float
    misfit: Misfit


def search_video_speed(
    path: Trajectory, first_s: float, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> ShownSpeed | None:
    """Return the speed that explains the fixes if that of time does not; None if none does.

    Where none does near the configured time offset, one that does so beyond doubt at another one counts.

    Args:
        path: Of the video alone, level; every scale and heading will do.
        first_s: Time of the video's first frame.
        fixes: Fixes at the times of their time stamps; used ones count.
        camera_p_antenna: (3,) metres.
        config: Time offset, how far about it others are searched, and how sure the speed must be.
    """
    if np.count_nonzero(fixes.used) <= MIN_PAIRS or len(path.t_s) < 2:
        return None
    near = _Search(path, first_s, fixes, camera_p_antenna, config, config.time_offset_reach_s)
    as_time = near.misfit(0.0, near.offsets_s)
    if _is_explained(as_time.misfit):
        return None
    if (shown := _shown(near, as_time, config)) is not None or np.ptp(path.t_s) > _LONG_S:
        return shown
    far = _Search(path, first_s, fixes, camera_p_antenna, config, REACH_S)
    as_time = far.misfit(0.0, far.offsets_s)
    shown = None if _is_explained(as_time.misfit) else _shown(far, as_time, config)
    return shown if shown is not None and shown.is_certain else None


def _shown(search: "_Search", as_time: _Speed, config: SensorsConfig) -> ShownSpeed | None:
    """Return the speed that explains the fixes at the time offsets of a search; None if none does.

    Args:
        search: Path and fixes.
        as_time: The speed of time, which does not explain them.
        config: How sure the speed must be.
    """
    logs = search.logs()
    left, offset_s = search.left_at(logs)
    near_s = _OFFSET_STEP_S * np.arange(-1.0, 2.0)
    found = [search.misfit(logs[k], offset_s[k] + near_s) for k in _lowest(left)]
    if not found:
        return None
    best = min(found, key=lambda one: one.misfit.cost)
    others = [one for one in (*found, as_time) if len(one.misfit.left) and abs(one.log - best.log) > _APART]
    tried = float(len(logs) * len(search.offsets_s))
    clear = [best.misfit.clearly_less(one.misfit, config.significance_sigmas, tried) for one in others]
    # where too few fixes are in the video at slower speeds, one of these may be the right one
    bounded = np.isfinite(left[np.abs(logs - best.log) < _APART]).all()
    certain = bool(clear and all(clear) and bounded)
    if not _is_explained(best.misfit) or not (certain or len(best.misfit.left) >= _MIN_DOUBTFUL_PAIRS):
        return None
    refined, _ = search.refined(best)
    return ShownSpeed(float(np.exp(refined.log)), certain, refined.offset_s)


def refined_video_speed(
    path: Trajectory, first_s: float, fixes: Fixes, camera_p_antenna: FloatArray, config: SensorsConfig
) -> tuple[float, float]:
    """Return the speed of a video whose frames have almost their right times, near one, and its relative
    standard deviation.

    Args:
        path, first_s, fixes, camera_p_antenna, config: As for :func:`search_video_speed`.
    """
    search = _Search(path, first_s, fixes, camera_p_antenna, config, config.time_offset_reach_s)
    found, sigma = search.refined(search.misfit(0.0, search.offsets_s))
    return float(np.exp(found.log)), sigma


def usual_video_speed(speed: float, sigma: float) -> float | None:
    """Return the whole number of times that a video plays faster, or slower; None unless that is much
    likelier than any other speed.

    So are time-lapses and slow motion made, to ``USUAL_SIGMA``.

    Args:
        speed: As found.
        sigma: Its relative standard deviation.
    """
    times = max(round(max(speed, 1.0 / speed)), 1)
    usual = float(times) if speed > 1.0 else 1.0 / times
    spread = float(np.hypot(sigma, USUAL_SIGMA))
    density = np.exp(-0.5 * (np.log(speed / usual) / spread) ** 2) / (np.sqrt(2.0 * np.pi) * spread)
    # others that are nearest to it are as likely, and spread over 1 / times in the logarithm
    return usual if density > _STRONG * times else None


def _lowest(left: FloatArray) -> list[int]:
    """Return the rows of the speeds that leave least (n,), each less than its neighbours, the best first."""
    beside = np.minimum(np.append(left[1:], np.inf), np.append(np.inf, left[:-1]))
    rows = np.flatnonzero((left <= beside) & np.isfinite(left))
    return [int(k) for k in rows[np.argsort(left[rows])][:_COMPARED]]


def _is_explained(misfit: Misfit) -> bool:
    """Return whether a path explains fixes; a few pairs always leave little."""
    residuals = 2.0 * len(misfit.left)
    return misfit.share * residuals < EXPLAINED_SHARE * misfit.degrees_of_freedom


def _spread(tried: list[_Speed], best: _Speed) -> float:
    """Return the standard deviation of the logarithm of the speed by the likelihoods of some."""
    less = np.array([one.misfit.cost - best.misfit.cost for one in tried])
    share = np.exp(-0.5 * best.misfit.degrees_of_freedom * less)
    away = np.array([one.log for one in tried]) - best.log
    return float(np.sqrt(share @ away**2 / share.sum()))


class _Search:
    """What speeds and time offsets leave of the fixes' displacements; times are since the first frame."""

    def __init__(
        self,
        path: Trajectory,
        first_s: float,
        fixes: Fixes,
        camera_p_antenna: FloatArray,
        config: SensorsConfig,
        reach_s: float,
    ) -> None:
        seen = seen_antenna(path, camera_p_antenna)
        self._seen = seen._replace(t_s=seen.t_s - first_s)
        compared = compared_fixes(fixes)
        self._fixes = replace(compared, t_s=compared.t_s - first_s)
        self._config = config.time_offset
        offsets_s = np.arange(-reach_s, reach_s + _OFFSET_STEP_S / 2, _OFFSET_STEP_S)
        self.offsets_s: FloatArray = config.time_offset_s + offsets_s

    def left_at(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the share of the motion (n,) that speeds leave, each at its best time offset (n,).

        Of least squares with one scale and one heading; infinite for speeds with too few pairs of fixes.
        """
        t_s, seen = self._fixes.t_s - self.offsets_s[:, None], self._seen
        place = self._fixes.world_p_fix[:, 0] + 1j * self._fixes.world_p_fix[:, 1]
        close = np.diff(self._fixes.t_s) <= self._config.max_pair_s
        left, offset_s = np.full(len(logs), np.inf), np.zeros(len(logs))
        for k, speed in enumerate(np.exp(logs).tolist()):
            inside = (t_s >= speed * seen.t_s[0]) & (t_s <= speed * seen.t_s[-1])
            pairs = inside[:, 1:] & inside[:, :-1] & close
            camera = np.diff(np.interp(t_s, speed * seen.t_s, seen.antenna)) * pairs
            wanted = np.diff(place) * pairs
            motion = np.sum(np.abs(camera) ** 2, axis=1) * np.sum(np.abs(wanted) ** 2, axis=1)
            alike = np.abs(np.sum(camera.conj() * wanted, axis=1)) ** 2
            share = np.where(pairs.sum(axis=1) >= MIN_PAIRS, 1.0 - alike / np.maximum(motion, 1e-12), np.inf)
            best = int(np.argmin(share))
            left[k], offset_s[k] = share[best], self.offsets_s[best]
        return left, offset_s

    def misfit(self, log: float, offsets_s: FloatArray) -> _Speed:
        """Return a speed at the best of some time offsets."""
        seen = self._seen._replace(t_s=np.exp(log) * self._seen.t_s)
        tried = [_Speed(log, x, misfit_at(seen, self._fixes, x, self._config)) for x in offsets_s.tolist()]
        return min(tried, key=lambda one: one.misfit.cost)

    def refined(self, near: _Speed) -> tuple[_Speed, float]:
        """Return the best speed near one that is right to a step, and its relative standard deviation.

        That is the spread of the likelihood, on the finer grid if that is wide enough for it.
        """
        sigma = 0.0
        for finer in (1.0, 0.2):
            step = finer * self._step(near.log)
            offsets_s: FloatArray = near.offset_s + finer * 2.0 * _OFFSET_STEP_S * _FINE
            tried = [self.misfit(log, offsets_s) for log in (near.log + step * _FINE).tolist()]
            near = min(tried, key=lambda one: one.misfit.cost)
            if sigma < step:
                sigma = _spread(tried, near)
        return near, sigma

    def logs(self) -> FloatArray:
        """Return the speeds (n,) that are compared, by which fixes may last as long as the video."""
        log_s = float(np.ptp(self._fixes.t_s)) + 2.0 * float(self.offsets_s.max() - self.offsets_s.min())
        fastest = np.log(min(_FASTEST, log_s / float(np.ptp(self._seen.t_s))))
        logs = [float(np.log(_SLOWEST))]
        while logs[-1] < fastest:
            logs.append(logs[-1] + self._step(logs[-1]))
        return np.array(logs)

    def _step(self, log: float) -> float:
        return min(_STEP, _SHIFT_S / float(np.exp(log) * np.ptp(self._seen.t_s)))
