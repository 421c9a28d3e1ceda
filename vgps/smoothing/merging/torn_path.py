"""The path of several maps, which the video does not join: what fixes say where it is torn.

Between two maps nothing but constant velocity is assumed. A map whose own fixes do not align it continues its
neighbour, and what several such steps make wrong, or one over a long gap, the fixes of the whole path mend.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from vgps.config import Config, DriftConfig
from vgps.gps.fixes import Fixes, place
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


def align_torn_path(
    maps: Sequence[LocalMap], path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> bool:
    """Align all maps with the fixes within them as one path; return whether these suffice.

    Args:
        maps: In order of time, none of which has two fixes; each continues its neighbour.
        path: Of all frames.
        fixes: Fixes with the time offset removed.
        camera_p_antenna: (3,) metres.
        config: Gives the prior of a level camera.
    """
    spans_s = [map_trajectory(one).t_s[[0, -1]] for one in maps]
    within = np.any([(fixes.t_s >= first) & (fixes.t_s <= last) for first, last in spans_s], axis=0)
    chosen = fixes_within(path, fixes.where(within))
    if len(chosen) < 2:
        return False
    to_world = align(correspondences(path, chosen, camera_p_antenna), config.start)
    if to_world is None:
        return False
    for local_map in maps:
        local_map.apply(MapUpdate(similarity=to_world))
    return True


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
    loose = config.model_copy(update={"drift": _drift_over_seams(maps, path, config)})
    poses, scale = remove_drift(path, inside, camera_p_antenna, loose)
    for local_map in continued:
        rows = slice(local_map.first_posed, local_map.next_frame)
        local_map.apply(move_frames(local_map, poses[rows], scale[rows]))


def _drift_over_seams(maps: Sequence[LocalMap], path: Trajectory, config: Config) -> DriftConfig:
    """Return the drift of a path with what it loses from map to map by random accelerations."""
    drift, motion = config.drift, config.motion
    gap_s = np.array([map_trajectory(after).t_s[0] - one.t_s[-1] for one, after in pairwise(maps)])
    speed = path.length_m / float(path.t_s[-1] - path.t_s[0])
    of_scale = np.sum(motion.translation_density**2 * 2.0 * gap_s / 3.0) / speed**2
    of_rotation = np.sum(motion.rotation_density**2 * gap_s**3 / 3.0)
    knots = max(len(path) / drift.knot_frames, 1.0)
    return drift.model_copy(
        update={
            "scale_sigma": float(np.hypot(drift.scale_sigma, np.sqrt(of_scale / knots))),
            "rotation_sigma_deg": float(
                np.hypot(drift.rotation_sigma_deg, np.degrees(np.sqrt(of_rotation / knots)))
            ),
        }
    )


def assess_pieces(
    maps: Sequence[LocalMap],
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
) -> FixAssessment:
    """Assess the fixes of each map by its own path: between maps no displacement is known.

    Args:
        maps: In order of time, in the world.
        path: Of all frames; those before the first map and after the last one count as theirs.
        fixes: Fixes with the time offset removed; those between maps are not assessed.
        camera_p_antenna: (3,) metres.
        config: Priors and drift rates.
    """
    assessment = FixAssessment.unassessed(len(fixes))
    for k, local_map in enumerate(maps):
        begin = local_map.first_posed if k else 0
        end = local_map.next_frame if k + 1 < len(maps) else len(path)
        if end - begin > 1:
            piece = Trajectory(path.t_s[begin:end], path.world_T_camera[begin:end])
            assessment = assessment.updated(detect_outliers(piece, fixes, camera_p_antenna, config))
    return assessment


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
