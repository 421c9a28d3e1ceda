"""The path of several maps, which the video does not join: what fixes say where it is torn.

Between two maps nothing but constant velocity is assumed. A map whose own fixes do not align it continues its
neighbour, and what several such steps make wrong, or one over a long gap, the fixes of the whole path mend.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from vgps.config import Config, MotionConfig
from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes
from vgps.gps.outlier_detection import FixAssessment, detect_outliers
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate
from vgps.mapping.trajectory import map_trajectory
from vgps.model import FloatArray
from vgps.smoothing.alignment.drift_correction import move_frames, remove_drift
from vgps.smoothing.alignment.map_alignment import correspondences, fixes_within
from vgps.smoothing.alignment.similarity import align
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Trajectory

_NEAR_S = 1.5  # from a map, in which the path may go on at the velocity that it has there
_SLOW_M_S = 0.1  # at least, or scale would mean nothing
_BESIDE_S = 0.5  # before the first map and after the last one, in which the path is as good as theirs


def align_torn_path(
    maps: Sequence[LocalMap], path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> bool:
    """Align all maps with the fixes within or near them as one path; return whether these suffice.

    Args:
        maps: In order of time, none of which has two fixes; each continues its neighbour.
        path: Of all frames.
        fixes: Fixes with the time offset removed.
        camera_p_antenna: (3,) metres.
        config: Gives the prior of a level camera.
    """
    away_s = _seconds_away(maps, fixes.t_s)
    chosen = fixes_within(path, fixes.where(away_s <= _NEAR_S))
    if len(chosen) < 2:
        return False
    seen = correspondences(path, chosen, camera_p_antenna)
    gap_s = float(np.mean(_gaps_s(maps))) if len(maps) > 1 else 0.0
    off_m = config.motion.translation_density * (_seconds_away(maps, chosen.t_s) + gap_s) ** 1.5
    seen = replace(seen, region_m=np.hypot(seen.region_m, off_m[:, None] / np.sqrt(3.0)))
    to_world = align(seen, config.start)
    if to_world is None:
        return False
    for local_map in maps:
        local_map.apply(MapUpdate(similarity=to_world))
    return True


def _seconds_away(maps: Sequence[LocalMap], t_s: FloatArray) -> FloatArray:
    """Return how far times (M,) are from the nearest map; 0 within one."""
    begin_s, end_s = np.array([map_trajectory(one).t_s[[0, -1]] for one in maps]).T[:, :, None]
    return np.asarray(np.maximum(np.maximum(begin_s - t_s, t_s - end_s), 0.0).min(axis=0))


def _gaps_s(maps: Sequence[LocalMap]) -> FloatArray:
    """Return the times (n - 1,) from the last frame of each map to the first of the next."""
    return np.array([map_trajectory(after).t_s[0] - one.t_s[-1] for one, after in pairwise(maps)])


def mend_torn_path(
    maps: Sequence[LocalMap],
    continued: Sequence[LocalMap],
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
) -> None:
    """Move the maps that continue their neighbours to where the fixes of the whole path have them.

    Args:
        maps: In order of time, in the world.
        continued: Those to move.
        path: Of all frames.
        fixes: Fixes with the time offset removed.
        camera_p_antenna: (3,) metres.
        config: Drift rates, and how fast velocities change.
    """
    inside = fixes.where(fixes.used & place(path.t_s, fixes.t_s).inside)
    if len(inside) < 2 or path.length_m == 0.0:
        return
    seams = _seams(maps, path, config.motion)
    poses, scale = remove_drift(path, inside, camera_p_antenna, config, seams=seams)
    for local_map in continued:
        rows = slice(local_map.first_posed, local_map.next_frame)
        local_map.apply(move_frames(local_map, poses[rows], scale[rows]))


def _seams(maps: Sequence[LocalMap], path: Trajectory, motion: MotionConfig) -> FloatArray:
    """Return the variances (F - 1, 2) of log scale and rotation [rad^2] that random accelerations make of the
    velocities from each map to the next."""
    seams, gaps_s = np.zeros((len(path) - 1, 2)), _gaps_s(maps)
    speed = max(path.length_m / float(np.ptp(path.t_s)), _SLOW_M_S)
    seams[[one.next_frame - 1 for one in maps[:-1]]] = np.stack(
        [
            motion.translation_density**2 * 2.0 * gaps_s / 3.0 / speed**2,
            motion.rotation_density**2 * gaps_s**3 / 3.0,
        ],
        axis=1,
    )
    return seams


def assess_parts(
    maps: Sequence[LocalMap],
    continued: Sequence[LocalMap],
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
) -> FixAssessment:
    """Assess the fixes of each map that fixes align by its own path, of others by that of those in a row.

    From a map that fixes align to another no displacement is known.

    Args:
        maps: In order of time, in the world.
        continued: Those that continue their neighbours.
        path: Of all frames.
        fixes: Fixes with the time offset removed; those between parts are not assessed.
        camera_p_antenna: (3,) metres.
        config: Priors and drift rates.
    """
    assessment = FixAssessment.unassessed(len(fixes))
    seams = _seams(maps, path, config.motion)
    begin_s, end_s = path.t_s[maps[0].first_posed] - _BESIDE_S, path.t_s[maps[-1].next_frame - 1] + _BESIDE_S
    parts = _parts(maps, continued)
    for k, (first, last) in enumerate(parts):
        begin = first.first_posed if k else int(np.searchsorted(path.t_s, begin_s))
        end = last.next_frame if k + 1 < len(parts) else int(np.searchsorted(path.t_s, end_s, side="right"))
        if end - begin > 1:
            part = Trajectory(path.t_s[begin:end], path.world_T_camera[begin:end])
            found = detect_outliers(part, fixes, camera_p_antenna, config, seams[begin : end - 1])
            assessment = assessment.updated(found)
    return assessment


def _parts(maps: Sequence[LocalMap], continued: Sequence[LocalMap]) -> list[tuple[LocalMap, LocalMap]]:
    """Return the first and last map of each part: maps that continue each other without a long gap."""
    follows = np.array([one in continued for one in maps])
    joined = follows[:-1] & follows[1:] & (_gaps_s(maps) < _NEAR_S)
    edges = [0, *(np.flatnonzero(~joined) + 1).tolist(), len(maps)]
    return [(maps[begin], maps[end - 1]) for begin, end in pairwise(edges)]


def untorn_path(path: Trajectory, scene: Scene, fixes: Fixes, fewest: int) -> Trajectory:
    """Return the longest part of a path that tracks join from frame to frame, by the fixes within it.

    Parts of a path of the video alone have a scale each. A step of the scale while a car accelerates would
    look like a time offset.

    Args:
        path: Over frames of the scene.
        scene: All frames.
        fixes: At the times of their time stamps; used ones count.
        fewest: Tracks that join two frames.
    """
    torn_s = scene.t_s[np.flatnonzero(scene.torn(fewest)) + 1]
    edges = np.unique(np.concatenate([[0], np.searchsorted(path.t_s, torn_s), [len(path)]]))
    if len(edges) < 3:
        return path
    used_s = fixes.t_s[fixes.used]

    def length(part: slice) -> tuple[int, int]:
        part_s = path.t_s[part]
        return int(np.sum((used_s >= part_s[0]) & (used_s <= part_s[-1]))), len(part_s)

    longest = max((slice(*ends) for ends in pairwise(edges.tolist())), key=length)
    return Trajectory(path.t_s[longest], path.world_T_camera[longest])
