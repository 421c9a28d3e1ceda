"""All maps of a video in one world, and a pose for every frame: what stage D starts from."""

from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.geometry import interpolate_poses
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment, detect_outliers, detects_outliers
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FloatArray
from vgps.smoothing.drift_correction import correct_drift
from vgps.smoothing.factor_graph import Scene
from vgps.smoothing.map_alignment import find_alignment
from vgps.smoothing.window import contradicts
from vgps.solution import FrameState, Observations


@dataclass(frozen=True)
class MergedMaps:
    """The scene, the state of each frame (F,), luminance of the features (L,) uint8, the judgement of the
    fixes that it was bent by, and warnings."""

    scene: Scene
    assessment: FixAssessment
    state: tuple[FrameState, ...]
    gray: np.ndarray
    georeferenced: bool
    warnings: tuple[str, ...]


def merge_maps(
    maps: list[LocalMap],
    t_s: FloatArray,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS,
    time_offset_s: float = 0.0,
) -> MergedMaps:
    """Put every map into the world, by its own fixes or by continuing its neighbour; pose every frame.

    Args:
        maps: In order of time, at least one; moved in place.
        t_s: (F,) times of all frames.
        fixes: All fixes.
        camera_p_antenna: (3,) metres.
        config: What it takes to align.
        controls: Observations of known points.
        time_offset_s: Of the fixes, as far as it is known.

    Raises:
        GeometryError: There are fixes, but no map could be aligned with them.
    """
    warnings: list[str] = []
    for local_map in maps:
        local_map.pose_standing_frames()
        if not local_map.aligned:
            found = find_alignment(local_map, t_s, fixes, camera_p_antenna, config.start)
            if found is not None:
                local_map.transform(found.scale, found.world_R_map, found.world_p_map)
                local_map.aligned = True
    georeferenced = any(local_map.aligned for local_map in maps)
    if not georeferenced and fixes.used.any():
        warnings.append(_align_at_last(maps, t_s, fixes, camera_p_antenna, config))
        georeferenced = True
    if not georeferenced:
        warnings.append("no fix ties the result to the world: place, heading and scale are arbitrary")
        maps[0].aligned = True
    warnings.extend(_continue_maps(maps, t_s))
    assessment = FixAssessment.none(len(fixes))
    path, _ = _every_frame(maps, t_s)
    in_time = fixes.earlier(time_offset_s)
    if georeferenced and detects_outliers(config):
        assessment = detect_outliers(path, t_s, in_time, camera_p_antenna, config)
    believed = assessment.applied(in_time)
    if georeferenced and config.gps.model != "none":
        for local_map in maps:
            if contradicts(local_map, t_s, believed, camera_p_antenna, config, whole=True):
                correct_drift(local_map, t_s, believed, camera_p_antenna, config)
    poses, state = _every_frame(maps, t_s)
    scene = replace(_scene(maps, t_s, poses), controls=controls)
    gray = np.concatenate([local_map.gray[_positioned(local_map)] for local_map in maps])
    return MergedMaps(scene, assessment, state, gray, georeferenced, tuple(warnings))


def _align_at_last(
    maps: list[LocalMap], t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> str:
    """Put the longest map into the world by fixes that hardly suffice; what to know about it."""
    start = config.start.model_copy(update={"min_travel_ratio": config.start.final_travel_ratio})
    longest = max(maps, key=lambda local_map: len(local_map.poses))
    found = find_alignment(longest, t_s, fixes, camera_p_antenna, start)
    if found is None:
        raise _not_aligned(fixes, config)
    longest.transform(found.scale, found.world_R_map, found.world_p_map)
    longest.aligned = True
    span, radius = _span(fixes)
    return (
        f"the fixes span {span:.1f} m, each good to {radius:.1f} m: scale and heading are poorly known, "
        f"which a way of {config.start.min_travel_ratio * radius:.0f} m or control points would show"
    )


def _span(fixes: Fixes) -> tuple[float, float]:
    """Extent of the used fixes, and their median radius, metres."""
    extent = float(np.linalg.norm(np.ptp(fixes.world_p_fix[fixes.used], axis=0)))
    return extent, float(np.median(fixes.r_m[fixes.used]))


def _not_aligned(fixes: Fixes, config: Config) -> GeometryError:
    span, radius = _span(fixes)
    needed = max(config.start.min_travel_m, config.start.final_travel_ratio * radius)
    return GeometryError(
        f"the {fixes.used.sum()} usable fixes span {span:.1f} m: too little for scale and heading",
        expected=f"{config.start.min_fixes} fixes or more that span {needed:.1f} m while tracking holds",
        remedy="record a longer way, or give control points",
    )


def _continue_maps(maps: list[LocalMap], t_s: FloatArray) -> list[str]:
    """Maps that no fix aligns go on where their neighbour ended, at its velocity."""
    warnings = []
    order = sorted(
        range(len(maps)), key=lambda k: min(abs(k - j) for j in range(len(maps)) if maps[j].aligned)
    )
    for k in order:
        if maps[k].aligned:
            continue
        before = k > 0 and maps[k - 1].aligned
        _continue(maps[k], maps[k - 1] if before else maps[k + 1], t_s, before)
        maps[k].aligned = True
        first, last = maps[k].first_posed, maps[k].next_frame - 1
        warnings.append(
            f"frames {first} to {last} ({t_s[first]:.1f} to {t_s[last]:.1f} s) have too few fixes of their "
            "own: they continue their neighbours' motion, scale included"
        )
    return warnings


def _continue(local_map: LocalMap, neighbour: LocalMap, t_s: FloatArray, after: bool) -> None:
    at = local_map.first_posed if after else local_map.next_frame - 1
    edge = neighbour.next_frame - 1 if after else neighbour.first_posed
    inner = max(neighbour.first_posed, edge - 5) if after else min(neighbour.next_frame - 1, edge + 5)
    ahead = min(local_map.next_frame - 1, at + 5) if after else max(local_map.first_posed, at - 5)
    velocity = (neighbour.pose(edge)[:3, 3] - neighbour.pose(inner)[:3, 3]) / (t_s[edge] - t_s[inner])
    own = (local_map.pose(ahead)[:3, 3] - local_map.pose(at)[:3, 3]) / (t_s[ahead] - t_s[at])
    scale = float(np.linalg.norm(velocity) / max(float(np.linalg.norm(own)), 1e-12))
    rotation = neighbour.pose(edge)[:3, :3] @ local_map.pose(at)[:3, :3].T
    target = neighbour.pose(edge)[:3, 3] + velocity * (t_s[at] - t_s[edge])
    local_map.transform(scale, rotation, target - scale * rotation @ local_map.pose(at)[:3, 3])


def _every_frame(maps: list[LocalMap], t_s: FloatArray) -> tuple[FloatArray, tuple[FrameState, ...]]:
    """Poses (F, 4, 4): tracked, or between and beyond tracked ones by time."""
    poses = np.full((len(t_s), 4, 4), np.nan)
    state = [FrameState.BRIDGED] * len(t_s)
    for local_map in maps:
        known = np.flatnonzero(np.isfinite(local_map.poses[:, 0, 0]))
        poses[known + local_map.first_frame] = local_map.poses[known]
        for frame in (known + local_map.first_frame).tolist():
            if frame not in local_map.bridged:
                state[frame] = FrameState.TRACKED
    known = np.flatnonzero(np.isfinite(poses[:, 0, 0]))
    missing = np.flatnonzero(np.isnan(poses[:, 0, 0]))
    poses[missing] = interpolate_poses(t_s[known], poses[known], t_s[missing])
    for frames, edge, inner in (
        (missing[missing < known[0]], known[0], known[min(1, len(known) - 1)]),
        (missing[missing > known[-1]], known[-1], known[max(-2, -len(known))]),
    ):
        velocity = (poses[edge, :3, 3] - poses[inner, :3, 3]) / max(abs(t_s[edge] - t_s[inner]), 1e-9)
        away = np.abs(t_s[frames] - t_s[edge])
        poses[frames, :3, 3] = poses[edge, :3, 3] + velocity * away[:, None]
    return poses, tuple(state)


def _positioned(local_map: LocalMap) -> np.ndarray:
    """Ids of features that have a position."""
    return np.flatnonzero(np.isfinite(local_map.points[:, 0]))


def _scene(maps: list[LocalMap], t_s: FloatArray, poses: FloatArray) -> Scene:
    points, frames, landmarks, uv = [], [], [], []
    ties: list[ZeroMotion] = []
    offset = 0
    for local_map in maps:
        ids = _positioned(local_map)
        row_of = np.full(local_map.feature_count, -1)
        row_of[ids] = offset + np.arange(len(ids))
        log = local_map.observations()
        known = row_of[log.landmark] >= 0
        frames.append(log.frame[known])
        landmarks.append(row_of[log.landmark[known]])
        uv.append(log.uv_px[known])
        points.append(local_map.points[ids])
        ties.extend(local_map.zero_motions)
        offset += len(ids)
    observations = Observations(np.concatenate(frames), np.concatenate(landmarks), np.concatenate(uv))
    return Scene(t_s, poses, np.concatenate(points), observations, tuple(ties))
