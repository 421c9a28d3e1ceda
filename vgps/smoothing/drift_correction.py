"""Take the drift of scale and heading out of a path by its fixes, before stages C and D optimise it.

A camera alone loses its scale slowly, in turns above all. Where older frames are held, or where the optimiser
starts from such a path, the cheapest way to shorten it under wide regions is to tilt it: a local minimum that
no later step leaves. So the path is bent first: its steps are scaled and turned by what changes slowly.
"""

import numpy as np

from vgps.config import Config
from vgps.gps.drift_model import DriftModel
from vgps.gps.fixes import Fixes
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.solver.landmark_refinement import move_with_frames

_FINEST_M = 0.3


def correct_drift(
    local_map: LocalMap,
    t_s: FloatArray,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    since_s: float = -np.inf,
) -> None:
    """Bend an aligned map, poses and points, towards its fixes, in place.

    Each point moves with the frame that saw it last.

    Args:
        local_map: All its frames posed.
        t_s: Times of all frames of the video so far.
        fixes: Those within the map's frames take part.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift, and whether the clock is known.
        since_s: What lies before stays; the rest hangs on it.
    """
    poses, times = path_of(local_map, t_s, since_s)
    first = local_map.next_frame - len(poses)
    inside = fixes.where(fixes.used & (fixes.t_s >= times[0]) & (fixes.t_s <= times[-1]))
    if len(inside) < 2:
        return
    attached = first > local_map.first_posed
    _move_frames(local_map, first, *bend_path(poses, times, inside, camera_p_antenna, config, attached))


def unbend(local_map: LocalMap, t_s: FloatArray, since_s: float) -> None:
    """Take back, in place, what fixes did to a map from a time on: its shape is what the frames saw.

    Where wrong fixes were believed the path tore to reach them, and no slow drift mends a tear.

    Args:
        local_map: All its frames posed.
        t_s: Times of all frames of the video so far.
        since_s: What lies before stays; the rest hangs on it.
    """
    poses, _ = seen_path(local_map, t_s, since_s)
    _move_frames(local_map, local_map.next_frame - len(poses), poses, np.ones(len(poses)))


def _move_frames(local_map: LocalMap, first: int, moved: FloatArray, scale: FloatArray) -> None:
    """Frames from one on to where they belong (n, 4, 4), their view grown (n,), with the points."""
    poses = local_map.poses[first - local_map.first_frame :]
    log = local_map.observations(first)
    anchor = np.full(local_map.feature_count, -1)
    anchor[log.landmark] = log.frame - first  # the log is in order of time: the last observation stays
    ids = np.flatnonzero((anchor >= 0) & np.isfinite(local_map.points[:, 0]))
    points = move_with_frames(local_map.points[ids], poses, moved, anchor[ids], scale[anchor[ids]])
    local_map.set_points(ids, points, local_map.sigma_px[ids])
    poses[:] = moved


def bend_path(
    poses: FloatArray,
    t_s: FloatArray,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    attached: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """The path with its drift taken out (F, 4, 4), and the scale (F,) by which each frame's view grew.

    Args:
        poses: (F, 4, 4), ``t_s`` (F,).
        fixes: All used and within the path's time.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift, and whether the clock is known.
        attached: The start hangs on a path that is held.
    """

    def path_with(time_offset_sigma_s: float) -> DriftModel:
        return DriftModel(poses, t_s, fixes, camera_p_antenna, config.drift, time_offset_sigma_s, attached)

    everything = np.ones(len(fixes), dtype=bool)
    in_step = path_with(0.0)
    regions = in_step.regions()
    found = in_step.settle(in_step.approach(everything, _FINEST_M), everything, regions)
    if not config.sensors.time_offset_prior_s:
        return in_step.bent(found)
    # a clock that is not in step must explain the fixes better: on a straight any lag does as well as none
    late = path_with(config.sensors.time_offset_prior_s)
    shifted = late.settle(found, everything, regions)
    gain = in_step.cost(found, everything, regions) - late.cost(shifted, everything, regions)
    return in_step.bent(found if gain <= config.sensors.significance_sigmas**2 else shifted)


def path_of(local_map: LocalMap, t_s: FloatArray, since_s: float = -np.inf) -> tuple[FloatArray, FloatArray]:
    """Poses of a map from its first posed frame or a later time on, and their times; ``t_s`` of all."""
    first = max(local_map.first_posed, int(np.searchsorted(t_s, since_s)))
    poses = local_map.poses[first - local_map.first_frame :]
    return poses, np.asarray(t_s[first : first + len(poses)])


def seen_path(
    local_map: LocalMap, t_s: FloatArray, since_s: float = -np.inf
) -> tuple[FloatArray, FloatArray]:
    """As :func:`path_of`, but with the ways from frame to frame that were seen when the frames came.

    Late fixes pull the path into their shape, where nothing shows any more that they are late.
    """
    poses, times = path_of(local_map, t_s, since_s)
    seen = local_map.steps[len(local_map.steps) - len(poses) + 1 :]
    steps = np.where(
        np.isfinite(seen), (poses[:-1, :3, :3] @ seen[:, :, None])[:, :, 0], np.diff(poses[:, :3, 3], axis=0)
    )
    out = poses.copy()
    out[1:, :3, 3] = poses[0, :3, 3] + np.cumsum(steps, axis=0)
    return out, times
