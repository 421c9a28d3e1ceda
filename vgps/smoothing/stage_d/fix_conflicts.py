"""RTK-fixes of one stretch that contradict each other, as the landmarks of stage D see it.

Outlier detection judges fixes by a path that may deform as visual odometry drifts, before stage D; a wrong
integer ambiguity of a few decimetres passes for such a drift, and the walls of RTK-fixes then bend the path
of stage D. Its landmarks are more accurate: within a stretch of RTK-fixes they show where the error of the
fixes changes by more than regions explain (:mod:`vgps.gps.error_steps`), but not which side of such a step is
right (:mod:`vgps.gps.fix_conflict`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import logit

from vgps.errors import GeometryError
from vgps.gps.antenna_path import place
from vgps.gps.error_steps import error_steps
from vgps.gps.fix_conflict import FixConflict, sides
from vgps.gps.fixes import CLASSES, Fixes, one_per_interval
from vgps.gps.outlier_detection import FixAssessment, detects_outliers
from vgps.gps.verdicts import SURE
from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.smoothing.scene.scene_part import SceneParts
from vgps.smoothing.stage_d.batch_problem import BatchInput
from vgps.smoothing.stage_d.batch_result import BatchResult, BatchSolution
from vgps.smoothing.stage_d.fix_error_equations import fix_error_equations

_LEAST_FIXES = 3
_INTERVAL_S = 1.0  # between the fixes compared: closer ones err alike
_WINDOW = 40  # fixes compared at once; half of them again with the next ones
_NEAR = 8  # of them to each side, with which those between two are compared
_PATH_SIGMAS = 3.0  # of the error of the video's path between neighbours
_MOST = 0.5  # of the right fixes: if fewer count as good and wrong ones do, verdicts took the other side


def find_conflicts(solved: BatchSolution, fixes: Fixes, assessment: FixAssessment) -> tuple[FixConflict, ...]:
    """Return the conflicts between RTK-fixes that verdicts do not settle.

    Args:
        solved: Stage D at its optimum.
        fixes: All fixes (M,) without verdicts, at the times of their time stamps.
        assessment: Their verdicts.
    """
    given, end = solved.given, solved.result.problem
    if given.context.rough or not detects_outliers(given.context.config):
        return ()
    scene = replace(given.scene, poses=end.world_T_camera, points=end.world_p_landmark)
    moved = replace(given, scene=scene, sensors=given.sensors.moved(end.shared))
    fixes = fixes.on_video_clock(moved.sensors)
    good = ~(assessment.rejected | assessment.down_classed)
    good &= np.isfinite(fixes.r_m) & place(scene.t_s, fixes.t_s).inside
    video = _Video(moved, SceneParts(scene), fixes)
    found = (_conflict(video, good, *stretch) for stretch in _stretches(moved, fixes))
    return tuple(one for one in found if one is not None)


def with_conflicts(result: BatchResult, conflicts: tuple[FixConflict, ...]) -> BatchResult:
    """Return the result with conflicts, their warnings and their share in the poses' covariance."""
    covariance, poses = result.covariance.copy(), result.trajectory.world_T_camera
    for one in conflicts:
        rows = slice(one.frames[0], one.frames[1] + 1)
        shift = poses[rows, :3, :3].transpose(0, 2, 1) @ one.otherwise_m
        covariance[rows, 3:, 3:] += one.probability * shift[:, :, None] * shift[:, None, :]
    warnings = (*result.warnings, *(one.note for one in conflicts))
    return replace(result, covariance=covariance, warnings=warnings, conflicts=conflicts)


def _stretches(given: BatchInput, fixes: Fixes) -> Iterator[tuple[IntArray, tuple[int, int]]]:
    """Yield the rows of each stretch of RTK-fixes within the video in which no gap is long, and its frames.

    These reach to the RTK-fixes before and after it, or to the ends of the video.
    """
    placement = place(given.scene.t_s, fixes.t_s)
    rtk = fixes.fix_class == CLASSES.index(FixClass.RTK_FIX)
    rows = np.flatnonzero(rtk & fixes.used & np.isfinite(fixes.r_m) & placement.inside)
    gaps = np.flatnonzero(np.diff(fixes.t_s[rows]) > given.context.config.gps.memory.max_gap_s) + 1
    if not len(rows):
        return
    first = [0, *placement.frame[rows[gaps - 1]].tolist()]
    last = [*placement.frame[rows[gaps]].tolist(), len(given.scene.t_s) - 1]
    yield from zip(np.split(rows, gaps), zip(first, last, strict=True), strict=True)


def _conflict(
    video: "_Video", good: BoolArray, stretch: IntArray, frames: tuple[int, int]
) -> FixConflict | None:
    """Return the conflict within a stretch of RTK-fixes; None if the verdicts ``good`` (M,) settle it.

    Fixes that are refused because of others than these do not take part.
    """
    fixes = video.fixes
    if good.sum() > good[stretch].sum():
        stretch = stretch[good[stretch]]
    compared = stretch[one_per_interval(fixes.t_s[stretch], _INTERVAL_S)]
    if len(compared) < _LEAST_FIXES or (differing := _differing(video, compared)) is None:
        return None
    is_right, error, otherwise_m, probability = differing
    side = _like_compared(video, stretch, compared, is_right)
    unclear = side < 0
    is_wrong = unclear | ~is_right[side]
    wrong, right = stretch[is_wrong], compared[is_right]
    if not (good[wrong].any() and np.mean(good[right]) < _MOST):
        right = right[good[right]]
    certain = probability < 1.0 - SURE and not good[wrong].any()
    if certain or not len(right):
        return None
    return FixConflict(
        right=right,
        wrong=wrong,
        error_m=np.where(unclear[:, None], np.nan, error[side])[is_wrong],
        wrong_s=(float(fixes.t_s[wrong[0]]), float(fixes.t_s[wrong[-1]])),
        otherwise_m=otherwise_m,
        probability=probability,
        frames=frames,
    )


class _Differing(NamedTuple):
    """Which fixes (k,) are right, their errors (k, 3), and those (3,) of the likeliest others with their
    probability."""

    is_right: BoolArray
    error_m: FloatArray
    otherwise_m: FloatArray
    probability: float


def _differing(video: "_Video", compared: IntArray) -> _Differing | None:
    """Return how the errors of the fixes compared differ; None if they do not."""
    steps = video.steps(compared)
    begins = np.append(True, steps[1:].any(axis=1))
    run, level = np.cumsum(begins) - 1, np.cumsum(steps, axis=0)[begins]
    alike = _alike(level, video.fixes.where(compared[begins]))
    found = sides(alike, np.bincount(run), _INTERVAL_S, video.given.context.config.outliers)
    if found is None:
        return None
    error = level - level[found.right].mean(axis=0)
    return _Differing(found.right[run], error[run], error[found.other].mean(axis=0), found.probability)


def _like_compared(video: "_Video", stretch: IntArray, compared: IntArray, right: BoolArray) -> IntArray:
    """Return for each fix of a stretch (n,) the one of those compared (k,) whose error it has, -1 if unclear.

    Where the error changes between two of these, the fixes between them are compared as well.
    """
    side = np.searchsorted(compared, stretch, side="right") - 1
    for before in np.flatnonzero(np.diff(right.astype(np.int8))).tolist():
        between = np.flatnonzero((stretch > compared[before]) & (stretch < compared[before + 1]))
        if not len(between):
            continue
        near = compared[max(before + 1 - _NEAR, 0) : before + 1 + _NEAR]
        rows = np.union1d(near, stretch[between])
        size = np.linalg.norm(video.steps(rows), axis=1)
        size[(rows <= compared[before]) | (rows > compared[before + 1])] = 0.0
        edge = rows[np.argmax(size)]
        side[between] = np.where(stretch[between] < edge, before, before + 1) if size.any() else -1
    return side


def _alike(level: FloatArray, fixes: Fixes) -> BoolArray:
    """Return which levels (K, 3) of the fixes' error are no farther apart (K, K) than their regions."""
    apart = level[:, None] - level
    plane, height = np.hypot(apart[..., 0], apart[..., 1]), np.abs(apart[..., 2])
    return np.asarray((plane <= fixes.r_m[:, None] + fixes.r_m) & (height <= fixes.h_m[:, None] + fixes.h_m))


@dataclass(frozen=True)
class _Video:
    """Steps of the errors of fixes (M,) as the scene of a solution shows them, part by part."""

    given: BatchInput
    parts: SceneParts
    fixes: Fixes

    def steps(self, rows: IntArray) -> FloatArray:
        """Return the steps (n, 3) of the error to each of these fixes from the one before; zero where none is
        certain.

        Windows overlap by half, and each finds the steps in its middle.
        """
        steps = np.zeros((len(rows), 3))
        half, last, done = _WINDOW // 2, max(len(rows) - _WINDOW, 0), 0
        for begin in sorted({*range(0, last, half), last}):
            end = len(rows) if begin == last else begin + _WINDOW - half // 2
            steps[done:end] = self._steps_within(rows[begin : begin + _WINDOW])[done - begin : end - begin]
            done = end
        return steps

    def _steps_within(self, rows: IntArray) -> FloatArray:
        fixes, scene, config = self.fixes.where(rows), self.given.scene, self.given.context.config
        frame = place(scene.t_s, fixes.t_s).frame
        part, ids = self.parts.between(int(frame[0]), int(frame[-1]) + 1)
        try:
            equations = fix_error_equations(self.given, part, ids, fixes)
        except GeometryError:  # what the video does not hold together contradicts nothing
            return np.zeros((len(fixes), 3))
        length = np.linalg.norm(np.diff(scene.poses[frame, :3, 3], axis=0), axis=1)
        path = _PATH_SIGMAS * config.gps.memory.path_share * length
        size = np.stack([fixes.r_m, fixes.h_m], axis=1)
        tolerance = np.sqrt(size[1:] ** 2 + size[:-1] ** 2 + path[:, None] ** 2)
        share = config.outliers.lower_share
        return error_steps(equations, tolerance, float(logit(SURE) - logit(share)))
