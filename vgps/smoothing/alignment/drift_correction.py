"""Correction of a path's drift in scale and heading by fixes, before stages C and D optimise it.

The scale of monocular odometry drifts slowly, mostly in turns. Where older frames are held, or where the
optimiser starts from such a path, tilting the path is the cheapest correction of its length under large
regions: a local minimum that the optimiser does not leave. So scale and rotation of the path's steps are
corrected first by a slowly varying drift.
"""

import numpy as np

from vgps.config import Config
from vgps.gps.drift_model import DriftModel
from vgps.gps.fixes import Fixes
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.mapping.trajectory import map_trajectory, odometry_trajectory
from vgps.model import FloatArray
from vgps.solution import Trajectory
from vgps.solver.landmark_refinement import move_with_frames


def correct_drift(
    local_map: LocalMap,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    since_s: float = -np.inf,
) -> MapUpdate:
    """Return the poses and points of an aligned map with its drift corrected by fixes.

    Each point moves with the frame that observed it last.

    Args:
        local_map: Aligned map, all frames posed.
        fixes: Fixes with the time offset removed; those within the map's frames are used.
        camera_p_antenna: (3,) metres.
        config: Drift rates, and the prior of the time offset.
        since_s: Frames before this time are not changed; the path continues from them.
    """
    path = map_trajectory(local_map, since_s)
    inside = fixes.where(fixes.used & (fixes.t_s >= path.t_s[0]) & (fixes.t_s <= path.t_s[-1]))
    if len(inside) < 2:
        return MapUpdate()
    attached = local_map.next_frame - len(path) > local_map.first_posed
    return move_frames(local_map, *remove_drift(path, inside, camera_p_antenna, config, attached))


def restore_odometry(local_map: LocalMap, since_s: float) -> MapUpdate:
    """Return the poses and points of a map with the shape of its odometry from a time on.

    Outliers that were used before distort the path abruptly, which no slow drift corrects.

    Args:
        local_map: Map, all frames posed.
        since_s: Frames before this time are not changed; the path continues from them.
    """
    poses = odometry_trajectory(local_map, since_s).world_T_camera
    return move_frames(local_map, poses, np.ones(len(poses)))


def move_frames(local_map: LocalMap, moved: FloatArray, scale: FloatArray) -> MapUpdate:
    """Return the last frames of a map at new poses, and the points moved with them.

    Args:
        local_map: The map.
        moved: (n, 4, 4) the new poses.
        scale: (n,) by which depths change.
    """
    first, positions = local_map.next_frame - len(moved), moved_points(local_map, moved, scale)
    return MapUpdate(first_frame=first, poses=moved, positions=positions)


def moved_points(local_map: LocalMap, moved: FloatArray, scale: FloatArray) -> Positions:
    """Return the points that the last frames of a map see, moved with the frames that saw them last.

    ``moved`` (n, 4, 4) and ``scale`` (n,) are those of :func:`move_frames`.
    """
    first = local_map.next_frame - len(moved)
    poses = local_map.poses[first - local_map.first_frame :]
    log = local_map.observations(first)
    anchor = np.full(local_map.feature_count, -1)
    anchor[log.landmark] = log.frame - first  # the log is chronological, so the last observation remains
    ids = np.flatnonzero((anchor >= 0) & np.isfinite(local_map.points[:, 0]))
    points = move_with_frames(local_map.points[ids], poses, moved, anchor[ids], scale[anchor[ids]])
    return Positions(ids, points, local_map.sigma_px[ids])


def remove_drift(
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    attached: bool = False,
    seams: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the path (F, 4, 4) without its drift, and the scale correction (F,) of each frame.

    Args:
        path: F frames.
        fixes: Fixes with the time offset removed, all used and within the path's time span.
        camera_p_antenna: (3,) metres.
        config: Drift rates, and the priors of time offset and tilt.
        attached: Whether the path continues one that is held, so that its start does not move.
        seams: As for :class:`vgps.gps.drift_model.DriftModel`.
    """
    tilt_sigma_rad = float(np.radians(config.start.level_sigma_deg))

    def model_with(time_offset_sigma_s: float) -> DriftModel:
        return DriftModel(
            path, fixes, camera_p_antenna, config.drift, time_offset_sigma_s, attached, tilt_sigma_rad, seams
        )

    everything = np.ones(len(fixes), dtype=bool)
    without_offset = model_with(0.0)
    regions = without_offset.regions()
    parameters = without_offset.refine(
        without_offset.fit_coarse_to_fine(everything, config.drift.finest_m), everything, regions
    )
    if not config.sensors.time_offset_prior_s:
        return without_offset.corrected(parameters)
    # a time offset must explain the fixes better; on a straight all offsets are equivalent
    with_offset = model_with(config.sensors.time_offset_prior_s)
    shifted = with_offset.refine(parameters, everything, regions)
    gain = without_offset.cost(parameters, everything, regions) - with_offset.cost(
        shifted, everything, regions
    )
    return without_offset.corrected(parameters if gain <= config.sensors.significance_sigmas**2 else shifted)
