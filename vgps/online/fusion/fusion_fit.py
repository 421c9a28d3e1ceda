"""One fit of the live path: to fixes that agree with it, or with verdicts on those that do not."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.gps.fixes import Fixes
from vgps.gps.learned_errors import with_errors
from vgps.gps.outlier_detection import FixAssessment, detect_outliers, detects_outliers
from vgps.model import BoolArray, IntArray
from vgps.online.fusion.clock_profile import (
    NOTHING_SHOWN,
    ProfiledClock,
    noisier_than_expected,
    profiled_time_offset,
    unsure_time_offset,
)
from vgps.online.fusion.clock_watch import shown_time_offset
from vgps.online.fusion.doubted_fixes import Doubt, doubt_about
from vgps.online.fusion.fusion_equations import TIME_OFFSET
from vgps.online.fusion.gravity import Gravity
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.live_errors import errors_in_fit, sizes_in_fit
from vgps.online.fusion.live_time_offset import with_time_offset_sigma
from vgps.online.fusion.node_fixes import SAME_TIME_S
from vgps.online.fusion.path_fusion import FusedPath, fuse
from vgps.online.fusion.turned_camera import TurnedPath, hides_a_turn, turned_path
from vgps.online.fusion.video_path import VideoPath
from vgps.solution import Trajectory

_SURPRISE = 14.2  # squared sigmas, which 99.7 % of Gaussian errors in space do not reach
_COMPARED_S, _TURNING_S = 8.0, 3.2  # of a path whose displacements, or unknown lever arm, show a clock
_MOST_JUDGED, _NEWEST_JUDGED = 120, 40  # fixes; thousands would take a second


@dataclass(frozen=True)
class FitResult:
    """A fit, and the verdicts (M,) on the fixes with sequence numbers (M,) that it follows.

    ``surprising``: whether its newest fixes call for verdicts. ``clock``: where displacements
    or fits with another time offset contradict this fit, if it was looked for. ``doubt``: about new
    fixes that the last fit contradicts. ``turned``: how the camera is, if the last fit had it otherwise.
    """

    fused: FusedPath
    number: IntArray
    assessment: FixAssessment
    surprising: bool = False
    clock: ProfiledClock = NOTHING_SHOWN
    doubt: Doubt | None = None
    turned: TurnedPath | None = None


@dataclass(frozen=True, kw_only=True)
class FitInput:
    """What a fit starts from: the map's path, the fixes, verdicts on earlier ones, and an IMU's vertical.

    ``is_new``: (M,) which fixes the last fit did not know; they come after it, but may be of a time before
    its end. ``watches_clock``: whether to look for another time offset, or a turned camera, once the fit is
    found; ``turned``: the latter. ``lever_arm``:
    as known so far; ``unsure_of_antenna``: whether the antenna may be farther off than a camera's own one;
    ``clock_away_s``: how far from what is believed the best of fits at other time offsets was.
    """

    path: VideoPath
    fixes: Fixes
    number: IntArray
    is_new: BoolArray
    assessment: FixAssessment
    lever_arm: LeverArm
    last: FusedPath | None
    gravity: Gravity | None = None
    watches_clock: bool = False
    unsure_of_antenna: bool = False
    clock_away_s: float = 0.0
    turned: TurnedPath | None = None


def fit(given: FitInput, config: Config) -> FitResult:
    """Return the fit to all fixes but those rejected before."""
    fixes = given.assessment.applied(given.fixes)
    fused = _learning_fit(given, fixes, config)
    if _surprises(fused, given, given.path, config):
        return FitResult(fused, given.number, given.assessment, surprising=True)
    if given.watches_clock and (turned := _turned_path(given, fused, config)) is not None:
        return fit_with_verdicts(replace(given, turned=turned), config)
    return _result(given, given.assessment, fused, config)


def newest_fit(given: FitInput, config: Config) -> FusedPath | None:
    """Return a fit to the fixes that came since the last fit, of the path since its last fix.

    It takes a fraction of the time of a whole fit, so that a pose need not go without them. Returns None if
    there are none, if one of them is older than that, or if they call for verdicts.
    """
    fixes, last = given.assessment.applied(given.fixes), given.last
    assert last is not None
    begin_s, new_s = float(last.nodes.t_s[last.last_fix]), fixes.t_s[fixes.used & given.is_new]
    if not len(new_s) or new_s.min() <= begin_s + SAME_TIME_S:
        return None
    path = given.path.since(begin_s)
    used = _doubting(_as_learned(config, last), given)
    fused = fuse(path, fixes, given.lever_arm, used, last, given.gravity)
    if fused.time_offset.sigma_s < last.time_offset.sigma_s:
        # what is carried has no bends of the path, so that a few fixes seem surer of the clock than all are
        covariance = with_time_offset_sigma(fused.covariance, TIME_OFFSET, last.time_offset.sigma_s)
        fused = replace(fused, time_offset=last.time_offset, covariance=covariance)
    return None if _surprises(fused, given, path, config) else fused


def fit_with_verdicts(given: FitInput, config: Config) -> FitResult:
    """Return verdicts on the fixes along the last fit, and the fit to those that take part.

    If all of them show that the camera is turned, along one with that.
    """
    if turned := given.turned or _turned_path(given, given.last, config):
        unassessed = FixAssessment.unassessed(len(given.fixes))
        given = replace(given, last=turned.fused, assessment=unassessed, turned=turned)
    path, last = given.path, given.last
    poses = path.poses if last is None else last.world_T_camera(path)
    judged = _judged(len(given.fixes))
    seen = path.t_s >= given.fixes.t_s[judged].min(initial=np.inf) - 1.0
    whole = Trajectory(path.t_s[seen], poses[seen])
    assessment = given.assessment
    if len(whole) >= 2:
        rest_s = 0.0 if last is None else last.time_offset.time_offset_s
        fixes = replace(given.fixes, used=given.fixes.used & judged).without_time_offset(rest_s)
        found = detect_outliers(whole, fixes, given.lever_arm.camera_p_antenna, config)
        assessment = assessment.updated(_with_fixes_between(found, given.fixes))
    fused = _learning_fit(given, assessment.applied(given.fixes), config)
    return _result(given, assessment, fused, config)


def _turned_path(given: FitInput, last: FusedPath | None, config: Config) -> TurnedPath | None:
    """Return how all fixes show the camera turned; None if they do not, or an IMU shows the vertical."""
    if last is None or given.gravity is not None:
        return None
    if not hides_a_turn(last, given.path, given.fixes, config):
        return None
    return turned_path(given.path, given.fixes, given.lever_arm, _doubting(config, given), last)


def _surprises(fused: FusedPath, given: FitInput, path: VideoPath, config: Config) -> bool:
    """Return whether what is new in a fit of a path, or of its end, calls for verdicts."""
    if not detects_outliers(config):
        return False
    if (last := given.last) is None:
        return True
    first_s = given.fixes.t_s[given.is_new].min(initial=np.inf)
    since_s = min(last.newest_s + SAME_TIME_S, float(first_s) - SAME_TIME_S)
    return fused.surprise(last, since_s, path, config) > _SURPRISE


def _result(given: FitInput, assessment: FixAssessment, fused: FusedPath, config: Config) -> FitResult:
    path, fixes, last = given.path, assessment.applied(given.fixes), given.last
    result = FitResult(fused, given.number, assessment, turned=given.turned)
    if last is not None and detects_outliers(config):
        doubt = doubt_about(fixes.where(given.is_new), last, fused, path, config)
        result = replace(result, doubt=doubt)
    if not given.watches_clock:
        return result
    return replace(result, clock=_watched_clock(given, fixes, fused, config))


def _watched_clock(given: FitInput, fixes: Fixes, fused: FusedPath, config: Config) -> ProfiledClock:
    """Return what displacements show of the clock, or else fits at other time offsets, where one is unsure of
    it or may be wrong."""
    path, believed = given.path, fused.time_offset
    path_s = path.t_s[-1] - path.t_s[0]
    if path_s >= _COMPARED_S and not given.unsure_of_antenna:  # of which displacements know nothing
        antenna = given.lever_arm.camera_p_antenna
        shown = shown_time_offset(path, fused.to_world(path), fixes, antenna, believed, config.sensors)
        if shown is not None:
            return ProfiledClock(shown)
    if (
        given.clock_away_s > 0.0
        or noisier_than_expected(fused)
        or (path_s >= _TURNING_S and given.unsure_of_antenna)
        or (path_s >= _COMPARED_S and unsure_time_offset(believed, config.sensors))
    ):
        return profiled_time_offset(path, fixes, fused, _as_learned(config, fused), given.gravity)
    return NOTHING_SHOWN


def _judged(count: int) -> BoolArray:
    """Return which of so many fixes, in order of time, are judged: the newest, and a share of those before.

    The newest alone, of a receiver that measures ten times a second, would be those of twelve seconds, in
    which wrong fixes soon outnumber the good ones before them.
    """
    judged = np.zeros(count, dtype=bool)
    older = max(count - _NEWEST_JUDGED, 0)
    judged[older:] = True
    judged[np.linspace(0, older - 1, min(_MOST_JUDGED - _NEWEST_JUDGED, older)).round().astype(int)] = True
    return judged


def _with_fixes_between(found: FixAssessment, fixes: Fixes) -> FixAssessment:
    """Return verdicts on all fixes (M,).

    One that was not judged has the worse verdict of the judged ones of its class before and after it.
    """
    judged, row = np.isfinite(found.nominal), np.arange(len(fixes))
    for kind in np.unique(fixes.fix_class[judged]):
        same = fixes.fix_class == kind
        of_kind, between = np.flatnonzero(judged & same), np.flatnonzero(~judged & same)
        after = np.searchsorted(of_kind, between)
        before, after = of_kind[np.maximum(after - 1, 0)], of_kind[np.minimum(after, len(of_kind) - 1)]
        row[between] = np.where(found.nominal[before] < found.nominal[after], before, after)
    return FixAssessment(found.nominal[row], found.lower[row])


def _as_learned(config: Config, last: FusedPath | None) -> Config:
    """Return settings with the errors of fixes as the last fit shows them."""
    if last is None:
        return config
    return config.model_copy(update={"gps": with_errors(config.gps, last.learned)})


def _doubting(config: Config, given: FitInput) -> Config:
    """Return settings with which no fit is surer of its clock than fits at other time offsets were."""
    trusted_s = float(np.hypot(config.sensors.trusted_time_offset_s, given.clock_away_s))
    sensors = config.sensors.model_copy(update={"trusted_time_offset_s": trusted_s})
    return config.model_copy(update={"sensors": sensors})


def _learning_fit(given: FitInput, fixes: Fixes, config: Config) -> FusedPath:
    """Return a fit with errors of fixes as the last one shows them, and with what it shows itself."""
    used = _as_learned(config, given.last)
    fused = fuse(given.path, fixes, given.lever_arm, _doubting(used, given), given.last, given.gravity)
    if not config.gps.learns:
        return fused.with_carried()
    shown = errors_in_fit(fused.nodes, fused.state, fused.system, config.gps, used.gps)
    learned, sizes = ({}, {}) if given.last is None else (given.last.learned, given.last.sizes)
    found = sizes_in_fit(fused.nodes, fused.state, fused.system, config.gps, sizes)
    return replace(fused, learned={**learned, **shown}, sizes={**sizes, **found}).with_carried()
