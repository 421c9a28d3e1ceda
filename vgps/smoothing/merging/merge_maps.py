"""Merge all maps of a video into one scene in the world, with a pose for every frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config, StartConfig
from vgps.geometry import interpolate_poses
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment, detects_outliers
from vgps.gps.sensors import Sensors
from vgps.mapping.between_views import pose_between_views
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Similarity
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import FloatArray
from vgps.smoothing.alignment.drift_correction import correct_drift
from vgps.smoothing.alignment.map_alignment import Alignment, find_alignment
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.merging.torn_path import align_torn_path, assess_parts, mend_torn_path
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_c.window import contradicts
from vgps.solution import FrameState, Observations, Trajectory

SCALE_UNKNOWN = "position, heading and scale are arbitrary", "position and heading are arbitrary"
"""What a video alone leaves open, without and with a known scale."""
_MOST_NAMED = 3  # parts of the path that a warning each tells of


@dataclass(frozen=True, kw_only=True)
class MergedMaps:
    """All maps in one world frame.

    Attributes:
        scene: Input of stage D.
        assessment: Assessment of the fixes before the drift correction.
        state: (F,) state of each frame.
        gray: (L,) luminance of the features, uint8.
        georeferenced: Whether fixes or control points define the world frame.
        warnings: Warnings for the user.
    """

    scene: Scene
    assessment: FixAssessment
    state: tuple[FrameState, ...]
    gray: np.ndarray
    georeferenced: bool
    warnings: tuple[str, ...]


def merge_maps(
    maps: Sequence[LocalMap], t_s: FloatArray, fixes: Fixes, sensors: Sensors, context: SmoothingContext
) -> MergedMaps:
    """Align every map with its fixes or else with its neighbour, and pose every frame.

    Args:
        maps: In chronological order, at least one; they are not changed.
        t_s: (F,) times of all frames.
        fixes: All fixes, at the times of their time stamps.
        sensors: Lever arm, and the time offset estimated so far.
        context: Control points, and settings.
    """
    config, antenna = context.config, sensors.camera_p_antenna
    maps = [local_map.snapshot() for local_map in maps]
    corrected = fixes.on_video_clock(sensors)
    georeferenced, continued, warnings = _place_maps(maps, t_s, corrected, antenna, config)
    assessment = FixAssessment.unassessed(len(fixes))
    if georeferenced and detects_outliers(config):
        path = Trajectory(t_s, _pose_all_frames(maps, t_s)[0])
        assessment = assess_parts(maps, continued, path, corrected, antenna, config)
    usable = assessment.applied(corrected)
    if georeferenced and config.gps.model != "none":
        for local_map in maps:
            if contradicts(local_map, usable, antenna, config, whole=True):
                local_map.apply(correct_drift(local_map, usable, antenna, config))
    poses, state = _pose_all_frames(maps, t_s)
    return MergedMaps(
        scene=_scene(maps, Trajectory(t_s, poses), context),
        assessment=assessment,
        state=state,
        gray=np.concatenate([local_map.gray[_positioned(local_map)] for local_map in maps]),
        georeferenced=georeferenced,
        warnings=tuple(warnings),
    )


def _place_maps(
    maps: Sequence[LocalMap], t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> tuple[bool, list[LocalMap], list[str]]:
    """Place all maps in one world.

    Returns:
        Whether fixes or control points define it, the maps that continue their neighbours, and warnings.
    """
    georeferenced, warnings = _align_maps(maps, fixes, camera_p_antenna, config)
    continued, told = _continue_maps(maps, t_s, config.mapping.edge_frames)
    path = Trajectory(t_s, _pose_all_frames(maps, t_s)[0])
    if not georeferenced and align_torn_path(maps, path, fixes, camera_p_antenna, config):
        georeferenced, continued, warnings, told = True, list(maps), [_torn(len(maps))], []
        path = Trajectory(t_s, _pose_all_frames(maps, t_s)[0])
    if georeferenced and continued and config.gps.model != "none":
        mend_torn_path(maps, continued, path, fixes, camera_p_antenna, config)
    return georeferenced, continued, warnings + told


def _align_maps(
    maps: Sequence[LocalMap], fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> tuple[bool, list[str]]:
    """Align each map with the fixes within it; return whether the result is georeferenced, and warnings.

    Maps whose fixes do not determine scale and heading continue those whose fixes do. If there are none, the
    map whose fixes determine the scale best is aligned all the same.
    """
    uncertain: list[tuple[LocalMap, Alignment]] = []
    for local_map in maps:
        local_map.apply(pose_between_views(local_map))
        found = None if local_map.aligned else find_alignment(local_map, fixes, camera_p_antenna, config)
        if found is not None and found.determined:
            local_map.apply(MapUpdate(similarity=found.to_world, aligned=True))
        elif found is not None:
            uncertain.append((local_map, found))
    if any(local_map.aligned for local_map in maps):
        return True, []
    if uncertain:
        local_map, found = min(uncertain, key=lambda one: one[1].sigmas.scale)
        local_map.apply(MapUpdate(similarity=found.to_world, aligned=True))
        return True, [_uncertain(found, config.start)]
    maps[0].apply(MapUpdate(aligned=True))
    why = (
        "no two fixes lie where tracking holds and the camera moves"
        if fixes.used.any()
        else ("no fix or control point ties the result to the world")
    )
    return False, [f"{why}: {SCALE_UNKNOWN[0]}; give a GPS log or control points"]


def _torn(maps: int) -> str:
    """Return the warning of maps that fixes align as a whole only."""
    which = f"none of its {maps} parts has" if maps > 1 else "it does not have"
    return (
        f"the path that the video shows is so short that {which} two fixes: it goes on at constant velocity, "
        "and fixes near it align the whole; record with more light and less motion blur"
    )


def _uncertain(found: Alignment, start: StartConfig) -> str:
    """Return the warning of a map that was aligned with fixes that do not determine it."""
    known = f"standard deviations of {found.sigmas}"
    if found.fixes < start.min_fixes:
        return (
            f"only {found.fixes} fixes tie the path to the world, and none checks them ({known}): record "
            "more fixes, or give control points"
        )
    short = max(
        found.sigmas.scale / start.scale_sigma,
        np.degrees(found.sigmas.heading_rad) / start.heading_sigma_deg,
    )
    if short <= 1.0:
        return (
            f"scale and heading hang on a part of the fixes ({known} if they are right): record a longer "
            "path, or give control points"
        )
    return (
        f"the fixes do not determine scale and heading ({known}; "
        f"wanted are {start.scale_sigma:.0%} and {start.heading_sigma_deg:g} degrees): record a path of "
        f"about {found.span_m * short:.0f} m instead of {found.span_m:.1f} m, or RTK-fixes, or give control "
        "points"
    )


def _continue_maps(
    maps: Sequence[LocalMap], t_s: FloatArray, edge_frames: int
) -> tuple[list[LocalMap], list[str]]:
    """Align maps without fixes by continuing their neighbour at constant velocity.

    Returns:
        These maps, and warnings.
    """
    continued = []
    order = sorted(
        range(len(maps)), key=lambda k: min(abs(k - j) for j in range(len(maps)) if maps[j].aligned)
    )
    for k in order:
        if maps[k].aligned:
            continue
        before = k > 0 and maps[k - 1].aligned
        neighbour = maps[k - 1] if before else maps[k + 1]
        to_world = _continuation(maps[k], neighbour, t_s, before, edge_frames)
        maps[k].apply(MapUpdate(similarity=to_world, aligned=True))
        continued.append(maps[k])
    spans = sorted((one.first_posed, one.next_frame - 1) for one in continued)
    named = [f"frames {first} to {last} ({t_s[first]:.1f} to {t_s[last]:.1f} s)" for first, last in spans]
    if len(spans) > _MOST_NAMED:
        named = [f"{len(spans)} parts of the path between frames {spans[0][0]} and {spans[-1][1]}"]
    extrapolated = "position, heading and scale are extrapolated from the neighbouring frames"
    return continued, [f"{which} have too few fixes to align them: {extrapolated}" for which in named]


def _continuation(
    local_map: LocalMap, neighbour: LocalMap, t_s: FloatArray, after: bool, edge_frames: int
) -> Similarity:
    """Return the similarity by which a map continues the motion of its neighbour."""
    at = local_map.first_posed if after else local_map.next_frame - 1
    edge = neighbour.next_frame - 1 if after else neighbour.first_posed
    inner = (
        max(neighbour.first_posed, edge - edge_frames)
        if after
        else min(neighbour.next_frame - 1, edge + edge_frames)
    )
    ahead = (
        min(local_map.next_frame - 1, at + edge_frames)
        if after
        else max(local_map.first_posed, at - edge_frames)
    )
    velocity = (neighbour.pose(edge)[:3, 3] - neighbour.pose(inner)[:3, 3]) / (t_s[edge] - t_s[inner])
    in_map = (local_map.pose(ahead)[:3, 3] - local_map.pose(at)[:3, 3]) / (t_s[ahead] - t_s[at])
    scale = float(np.linalg.norm(velocity) / max(float(np.linalg.norm(in_map)), 1e-12))
    rotation = neighbour.pose(edge)[:3, :3] @ local_map.pose(at)[:3, :3].T
    target = neighbour.pose(edge)[:3, 3] + velocity * (t_s[at] - t_s[edge])
    return Similarity(scale, rotation, target - scale * rotation @ local_map.pose(at)[:3, 3])


def _pose_all_frames(maps: Sequence[LocalMap], t_s: FloatArray) -> tuple[FloatArray, tuple[FrameState, ...]]:
    """Return poses (F, 4, 4), inter- or extrapolated where frames were not tracked, and states (F,)."""
    poses = np.full((len(t_s), 4, 4), np.nan)
    state = [FrameState.BRIDGED] * len(t_s)
    for local_map in maps:
        known = np.flatnonzero(np.isfinite(local_map.poses[:, 0, 0]))
        poses[known + local_map.first_frame] = local_map.poses[known]
        for frame in set((known + local_map.first_frame).tolist()) - local_map.bridged:
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
    """Return the ids of features that have a position."""
    return np.flatnonzero(np.isfinite(local_map.points[:, 0]))


def _scene(maps: Sequence[LocalMap], path: Trajectory, context: SmoothingContext) -> Scene:
    """Return the scene of all maps."""
    points, observations = [], []
    ties: list[ZeroMotion] = []
    offset = 0
    for local_map in maps:
        ids = _positioned(local_map)
        row_of = np.full(local_map.feature_count, -1)
        row_of[ids] = offset + np.arange(len(ids))
        log = local_map.observations()
        known = log.rows(row_of[log.landmark] >= 0)
        observations.append(replace(known, landmark=row_of[known.landmark]))
        points.append(local_map.points[ids])
        ties.extend(local_map.zero_motions)
        offset += len(ids)
    return Scene(
        path.t_s,
        path.world_T_camera,
        np.concatenate(points),
        Observations.stacked(observations),
        tuple(ties),
        context.controls,
    )
