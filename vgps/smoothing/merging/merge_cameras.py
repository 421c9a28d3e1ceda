"""Merge the maps of all cameras of a rig into one scene on one path, that of the reference camera.

Each camera was tracked by itself. The path comes from the camera that was tracked in most frames, of those
that lie in the world if any does, and, where that one was lost, from the others. All features are
triangulated again on it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FloatArray, IntArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.merging.merge_maps import MergedMaps, merge_maps
from vgps.smoothing.merging.rig_paths import (
    CameraPath,
    fill_from_other_camera,
    metres_per_unit,
    relative_scale,
)
from vgps.smoothing.scene.rig_views import RigViews
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.scene.triangulation import triangulated
from vgps.solution import FrameState, Observations

_SAME_S = 1e-4  # frames that differ by less are of one time
_MIN_VIEWS = 2


@dataclass(frozen=True)
class CameraMaps:
    """What stages A to C found of a camera of a rig.

    Attributes:
        maps: Its maps in order of time; none if it was never tracked.
        t_s: (F,) times of its frames.
        sensors: Lever arm from this camera, and the time offset estimated so far.
        name: Name of the camera.
    """

    maps: Sequence[LocalMap]
    t_s: FloatArray
    sensors: Sensors
    name: str


@dataclass(frozen=True)
class _Tracked:
    """A camera that was tracked: its number, its maps in one world, its times and its path."""

    number: int
    found: CameraMaps
    merged: MergedMaps
    path: CameraPath


def merge_cameras(found: Sequence[CameraMaps], fixes: Fixes, context: SmoothingContext) -> MergedMaps:
    """Return the maps of all cameras on one path.

    Args:
        found: The reference camera's first, then those of the context; at least one has a map.
        fixes: All fixes, at the times of their time stamps.
        context: Cameras, control points and settings.
    """
    t_s = found[0].t_s
    cameras = [_tracked(k, one, t_s, fixes, context) for k, one in enumerate(found) if one.maps]
    best, *others = sorted(
        cameras, key=lambda one: (one.merged.georeferenced, int(one.path.tracked.sum())), reverse=True
    )
    scale, notes = _metric(best, others)
    poses, tracked = best.path.scaled(scale).of_reference, best.path.tracked
    scales = {best.number: scale}
    for one in others:
        own = 1.0 if one.merged.georeferenced else relative_scale(best.path, one.path)
        scales[one.number] = scale * own
        before = int(tracked.sum())
        poses, tracked = fill_from_other_camera(poses, tracked, one.path.scaled(scale * own))
        if tracked.sum() > before:
            notes.append(f"camera {one.found.name} gives the path in {tracked.sum() - before} frames")
    return replace(
        best.merged,
        scene=_scene(cameras, t_s, poses, scales, context),
        state=tuple(FrameState.TRACKED if one else FrameState.BRIDGED for one in tracked.tolist()),
        gray=np.concatenate([one.merged.gray for one in cameras]),
        warnings=(*best.merged.warnings, *notes),
    )


def _tracked(
    number: int, found: CameraMaps, t_s: FloatArray, fixes: Fixes, context: SmoothingContext
) -> _Tracked:
    own = context if number == 0 else replace(context, controls=NO_CONTROL_OBSERVATIONS)
    merged = merge_maps(found.maps, found.t_s, fixes, found.sensors, own)
    mount = np.eye(4) if number == 0 else context.cameras[number - 1].reference_T_camera
    tracked = np.array(merged.state) == FrameState.TRACKED
    path = CameraPath(merged.scene.poses, tracked, mount).at(found.t_s, t_s)
    return _Tracked(number, found, merged, path)


def _metric(best: _Tracked, others: Sequence[_Tracked]) -> tuple[float, list[str]]:
    """Return metres per unit of the best path, and a note on it unless it is in the world."""
    if best.merged.georeferenced:
        return 1.0, []
    scale, sigma = metres_per_unit(best.path, [one.path for one in others])
    if not np.isfinite(sigma):
        return scale, []
    return scale, [f"the scale comes from the distances of the cameras, uncertain by {sigma:.1%}"]


def _scene(
    cameras: Sequence[_Tracked],
    t_s: FloatArray,
    poses: FloatArray,
    scales: Mapping[int, float],
    context: SmoothingContext,
) -> Scene:
    """Return the scene of all cameras on the path of the reference."""
    observations, numbers = [], []
    delay_s = np.zeros((1 + len(context.cameras), len(t_s)))
    standing: dict[int, ZeroMotion] = {}
    count = 0
    for one in cameras:
        scene, of = one.merged.scene, frames_of(one.found.t_s, t_s)
        late = one.found.t_s - t_s[of]
        delay_s[one.number, of[of >= 0]] = np.where(np.abs(late) < _SAME_S, 0.0, late)[of >= 0]
        known = scene.observations.rows(of[scene.observations.frame] >= 0)
        observations.append(Observations(of[known.frame], count + known.landmark, known.uv_px))
        numbers.append(np.full(len(scene.points), one.number))
        count += len(scene.points)
        standing = {**_standing(one, of, scales[one.number]), **standing}
    scene = Scene(
        t_s,
        poses,
        np.zeros((count, 3)),
        Observations.stacked(observations),
        tuple(standing.values()),
        context.controls,
        rig=RigViews(np.concatenate(numbers), delay_s),
    )
    return triangulated(scene, np.ones(count, dtype=bool), context, _MIN_VIEWS)


def frames_of(own_s: FloatArray, t_s: FloatArray) -> IntArray:
    """Return the frame of the reference, at times t_s (F,), nearest to each of a camera's; -1 for none.

    Each frame of the reference gets at most one, no farther away than half the time between its frames.
    """
    at = np.clip(np.searchsorted(t_s, own_s), 1, max(len(t_s) - 1, 1))
    nearest = np.where(own_s - t_s[at - 1] < t_s[at] - own_s, at - 1, at)
    distance = np.abs(own_s - t_s[nearest])
    order = np.argsort(distance, kind="stable")
    _, first = np.unique(nearest[order], return_index=True)
    chosen = order[first]
    chosen = chosen[distance[chosen] <= 0.5 * np.median(np.diff(t_s)) + _SAME_S]
    frames = np.full(len(own_s), -1)
    frames[chosen] = nearest[chosen]
    return frames


def _standing(one: _Tracked, of: IntArray, scale: float) -> dict[int, ZeroMotion]:
    """Return the zero-motion constraints of a camera as those of the reference."""
    mount = one.path.reference_T_camera
    constraints = {}
    for held in one.merged.scene.zero_motions:
        frame, reference = int(of[held.frame]), int(of[held.reference])
        if frame >= 0 and reference >= 0:
            moved = held.scaled(scale)
            relative = mount @ moved.reference_T_frame @ np.linalg.inv(mount)
            constraints[frame] = ZeroMotion(frame, reference, relative, moved.sigma)
    return constraints
