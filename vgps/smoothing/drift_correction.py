"""Take the drift of scale and heading out of a path by its fixes, before stages C and D optimise it.

A camera alone loses its scale slowly, in turns above all. Where older frames are held, or where the optimiser
starts from such a path, the cheapest way to shorten it under wide regions is to tilt it: a local minimum that
no later step leaves. So the path is bent first: its steps are scaled and rotated by what changes slowly.
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
    """Bend an aligned map, poses and points, towards its fixes.

    Each point moves with the frame that saw it last.

    Args:
        local_map: All its frames posed.
        fixes: In time; those within the map's frames take part.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift, and whether the time offset is known.
        since_s: What lies before stays, and the rest hangs on it.
    """
    path = map_trajectory(local_map, since_s)
    inside = fixes.where(fixes.used & (fixes.t_s >= path.t_s[0]) & (fixes.t_s <= path.t_s[-1]))
    if len(inside) < 2:
        return MapUpdate()
    attached = local_map.next_frame - len(path) > local_map.first_posed
    return _moved_frames(local_map, *bend_path(path, inside, camera_p_antenna, config, attached))


def undo_bending(local_map: LocalMap, since_s: float) -> MapUpdate:
    """Give a map its odometry's shape again from a time on.

    Where wrong fixes were believed the path tore to reach them, and no slow drift mends a tear.

    Args:
        local_map: All its frames posed.
        since_s: What lies before stays, and the rest hangs on it.
    """
    poses = odometry_trajectory(local_map, since_s).world_T_camera
    return _moved_frames(local_map, poses, np.ones(len(poses)))


def _moved_frames(local_map: LocalMap, moved: FloatArray, scale: FloatArray) -> MapUpdate:
    """Move the last frames to (n, 4, 4), their views grown by ``scale`` (n,), and the points with them."""
    first = local_map.next_frame - len(moved)
    poses = local_map.poses[first - local_map.first_frame :]
    log = local_map.observations(first)
    anchor = np.full(local_map.feature_count, -1)
    anchor[log.landmark] = log.frame - first  # the log is in order of time: the last observation stays
    ids = np.flatnonzero((anchor >= 0) & np.isfinite(local_map.points[:, 0]))
    points = move_with_frames(local_map.points[ids], poses, moved, anchor[ids], scale[anchor[ids]])
    return MapUpdate(
        first_frame=first, poses=moved, positions=Positions(ids, points, local_map.sigma_px[ids])
    )


def bend_path(
    path: Trajectory,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    attached: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Return the path without its drift (F, 4, 4), and the scale (F,) by which each frame's view grew.

    Args:
        path: F frames.
        fixes: In time, all used and within the path's time.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift, and whether the time offset is known.
        attached: The start hangs on a path that is held.
    """

    def model_with(time_offset_sigma_s: float) -> DriftModel:
        return DriftModel(path, fixes, camera_p_antenna, config.drift, time_offset_sigma_s, attached)

    everything = np.ones(len(fixes), dtype=bool)
    in_step = model_with(0.0)
    regions = in_step.regions()
    found = in_step.refine(in_step.fit_coarse_to_fine(everything, config.drift.finest_m), everything, regions)
    if not config.sensors.time_offset_prior_s:
        return in_step.corrected(found)
    # a time offset must explain the fixes better: on a straight any offset does as well as none
    late = model_with(config.sensors.time_offset_prior_s)
    shifted = late.refine(found, everything, regions)
    gain = in_step.cost(found, everything, regions) - late.cost(shifted, everything, regions)
    return in_step.corrected(found if gain <= config.sensors.significance_sigmas**2 else shifted)
