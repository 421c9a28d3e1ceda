"""Take the drift of scale and heading out of a path by its fixes, before stages C and D optimise it.

A camera alone loses its scale slowly, in turns above all. Where older frames are held, or where the optimiser
starts from such a path, the cheapest way to shorten it under wide regions is to tilt it: a local minimum that
no later step leaves. So the path is bent first: its steps are scaled and turned by amounts that change slowly.
"""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vgps.config import DriftConfig
from vgps.local_map import LocalMap
from vgps.model import FloatArray, IntArray
from vgps.smoothing.fixes import Fixes, antenna_at, place

_MAX_KNOTS = 100


def correct_drift(
    local_map: LocalMap, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: DriftConfig
) -> None:
    """Bend an aligned map, poses and points, towards its fixes, in place.

    Minimises ``sum rho(||(antenna - fix) / region||) + sum ||change of log scale and rotation per knot||^2``;
    each point moves with the frame that saw it last.

    Args:
        local_map: All its frames posed.
        t_s: Times of all frames of the video so far.
        fixes: Those within the map's frames take part.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift.
    """
    first = local_map.first_posed
    poses = local_map.poses[first - local_map.first_frame :]
    times = t_s[first : first + len(poses)]
    inside = fixes.where(fixes.used & (fixes.t_s >= times[0]) & (fixes.t_s <= times[-1]))
    if len(inside) < 2:
        return
    bent, scale = bend_path(poses, times, inside, camera_p_antenna, config)
    log = local_map.observations(first)
    anchor = np.full(local_map.feature_count, -1)
    anchor[log.landmark] = log.frame - first  # the log is in order of time: the last sighting stays
    ids = np.flatnonzero((anchor >= 0) & np.isfinite(local_map.points[:, 0]))
    points = _carried(local_map.points[ids], poses, bent, scale, anchor[ids])
    local_map.set_points(ids, points, local_map.sigma_px[ids])
    local_map.poses[first - local_map.first_frame :] = bent


def bend_path(
    poses: FloatArray, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: DriftConfig
) -> tuple[FloatArray, FloatArray]:
    """The path with its drift taken out (F, 4, 4), and the scale (F,) by which each frame's view grew.

    Args:
        poses: (F, 4, 4), ``t_s`` (F,).
        fixes: All used and within the path's time.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift.
    """
    spacing = max(config.knot_frames, len(poses) / _MAX_KNOTS)
    knots = np.linspace(0, len(poses) - 1, 2 + int(len(poses) / spacing))
    placement = place(t_s, fixes.t_s)
    region = np.stack([fixes.r_m, fixes.r_m, fixes.h_m], axis=1)
    sigma = np.array([config.scale_sigma, *[np.radians(config.rotation_sigma_deg)] * 3])

    def residual(parameters: FloatArray) -> FloatArray:
        bent, _ = _bent(poses, knots, parameters)
        offset = antenna_at(bent, placement, camera_p_antenna) - fixes.world_p_fix
        away = np.linalg.norm(offset / region, axis=1)
        robust = np.sqrt(np.log1p(away**2))  # Cauchy: a wrong fix bends nothing
        change = np.diff(parameters[3:].reshape(-1, 4), axis=0) / sigma
        return np.concatenate([robust, change.ravel()])

    best = least_squares(residual, np.zeros(3 + 4 * len(knots)), max_nfev=config.iterations, x_scale="jac")
    return _bent(poses, knots, best.x)


def _bent(poses: FloatArray, knots: FloatArray, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Steps scaled and turned by what is interpolated between knots, from a shifted start."""
    frames = np.arange(len(poses))
    by_knot = parameters[3:].reshape(-1, 4)
    log_scale, *turn = (np.interp(frames, knots, column) for column in by_knot.T)
    rotation = Rotation.from_rotvec(np.stack(turn, axis=1)).as_matrix()
    scale = np.exp(np.clip(log_scale, -5.0, 5.0))
    steps = np.diff(poses[:, :3, 3], axis=0)
    turned = scale[:-1, None] * (rotation[:-1] @ steps[:, :, None])[:, :, 0]
    out = poses.copy()
    out[:, :3, :3] = rotation @ poses[:, :3, :3]
    out[0, :3, 3] = poses[0, :3, 3] + parameters[:3]
    out[1:, :3, 3] = out[0, :3, 3] + np.cumsum(turned, axis=0)
    return out, scale


def _carried(
    points: FloatArray, poses: FloatArray, bent: FloatArray, scale: FloatArray, anchor: IntArray
) -> FloatArray:
    """Points (n, 3) at the same place in the view of their frames ``anchor`` (n,), at the new scale."""
    old, new = poses[anchor], bent[anchor]
    in_camera = ((points - old[:, :3, 3])[:, None, :] @ old[:, :3, :3])[:, 0]
    moved = (new[:, :3, :3] @ (scale[anchor, None] * in_camera)[:, :, None])[:, :, 0]
    return np.asarray(moved + new[:, :3, 3])
