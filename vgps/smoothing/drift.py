"""Take the drift of scale and heading out of a path by its fixes, before stages C and D optimise it.

A camera alone loses its scale slowly, in turns above all. Where older frames are held, or where the optimiser
starts from such a path, the cheapest way to shorten it under wide regions is to tilt it: a local minimum that
no later step leaves. So the path is bent first: its steps are scaled and turned by what changes slowly.
"""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vgps.config import DriftConfig
from vgps.local_map import LocalMap
from vgps.model import FloatArray, IntArray
from vgps.smoothing.fixes import Fixes, antenna_at, place

_MAX_KNOTS = 60
_LOSS_WIDTHS = (300.0, 30.0, 3.0)  # in regions


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

    The loss is Cauchy's, at first so wide that a drift of many regions is pulled back, then narrow enough
    that a wrong fix bends nothing.

    Args:
        poses: (F, 4, 4), ``t_s`` (F,).
        fixes: All used and within the path's time.
        camera_p_antenna: (3,) metres.
        config: How fast scale and rotation may drift.
    """
    path = _Path(poses, t_s, fixes, camera_p_antenna, config)
    parameters = np.zeros(3 + 4 * path.knots)
    for width in _LOSS_WIDTHS:
        parameters = least_squares(
            path.residual, parameters, path.jacobian, max_nfev=config.iterations, args=(width,), x_scale=1.0
        ).x
    return path.bent(parameters)


class _Path:
    """Residuals of a path whose steps are scaled and turned by what is interpolated between knots.

    Parameters: (3,) shift of the start [m], then log scale and rotation vector of every knot (4 K,).
    """

    def __init__(
        self,
        poses: FloatArray,
        t_s: FloatArray,
        fixes: Fixes,
        camera_p_antenna: FloatArray,
        config: DriftConfig,
    ) -> None:
        self.knots = 2 + min(int(len(poses) / config.knot_frames), _MAX_KNOTS)
        at = np.linspace(0, len(poses) - 1, self.knots)
        frames = np.arange(len(poses))
        # (F, K) how much each knot counts in each frame
        self._share = np.stack([np.interp(frames, at, row) for row in np.eye(self.knots)], axis=1)
        self._poses, self._fixes, self._antenna = poses, fixes, camera_p_antenna
        self._placement = place(t_s, fixes.t_s)
        self._region = np.stack([fixes.r_m, fixes.r_m, fixes.h_m], axis=1)
        sigma = np.array([config.scale_sigma, *[np.radians(config.rotation_sigma_deg)] * 3])
        # the walk's variance grows with the frames between knots
        self._sigma = sigma * np.sqrt(max((at[1] - at[0]) / config.knot_frames, 1e-9))

    def bent(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The path (F, 4, 4) and its scale (F,)."""
        by_frame = self._share @ parameters[3:].reshape(-1, 4)
        scale = np.exp(np.clip(by_frame[:, 0], -5.0, 5.0))
        rotation = Rotation.from_rotvec(by_frame[:, 1:]).as_matrix()
        steps = np.diff(self._poses[:, :3, 3], axis=0)
        turned = scale[:-1, None] * (rotation[:-1] @ steps[:, :, None])[:, :, 0]
        out = self._poses.copy()
        out[:, :3, :3] = rotation @ self._poses[:, :3, :3]
        out[0, :3, 3] += parameters[:3]
        out[1:, :3, 3] = out[0, :3, 3] + np.cumsum(turned, axis=0)
        return out, scale

    def residual(self, parameters: FloatArray, width: float) -> FloatArray:
        """(M + 4 (K - 1),): robust distances in regions, changes from knot to knot in sigmas."""
        away, _ = self._away(self.bent(parameters)[0])
        change = np.diff(parameters[3:].reshape(-1, 4), axis=0) / self._sigma
        return np.concatenate([width * np.sqrt(np.log1p((away / width) ** 2)), change.ravel()])

    def _away(self, bent: FloatArray) -> tuple[FloatArray, FloatArray]:
        offset = antenna_at(bent, self._placement, self._antenna) - self._fixes.world_p_fix
        return np.linalg.norm(offset / self._region, axis=1), offset

    def jacobian(self, parameters: FloatArray, width: float) -> FloatArray:
        """Of :meth:`residual`; the rotation's curvature and the lever arm's turning are left out, which
        changes the way to the minimum and not the minimum."""
        bent, _ = self.bent(parameters)
        away, offset = self._away(bent)
        steps = np.diff(bent[:, :3, 3], axis=0, prepend=bent[:1, :3, 3])
        zero = np.zeros(len(steps))
        x, y, z = steps.T
        # a step's derivative to log scale and to a turn w: the step itself, and w x step
        by_own = np.stack(
            [steps, *np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(0, 2, 1)], axis=1
        )
        share = np.vstack([self._share[:1], self._share[:-1]])
        by_knot = np.cumsum(share[:, :, None, None] * by_own[:, None], axis=0)  # (F, K, 4, 3)
        frame, alpha = self._placement.frame, self._placement.alpha[:, None, None, None]
        at_fix = (1.0 - alpha) * by_knot[frame] + alpha * by_knot[frame + 1]
        value = width * np.sqrt(np.log1p((away / width) ** 2))
        slope = np.where(value > 1e-9, away / np.maximum(value, 1e-9) / (1.0 + (away / width) ** 2), 1.0)
        by_offset = slope[:, None] * offset / self._region**2 / np.maximum(away, 1e-9)[:, None]
        fixes = np.concatenate(
            [by_offset, np.einsum("mkai,mi->mka", at_fix, by_offset).reshape(len(away), -1)], axis=1
        )
        change = np.kron(np.diff(np.eye(self.knots), axis=0), np.diag(1.0 / self._sigma))
        return np.vstack([fixes, np.hstack([np.zeros((len(change), 3)), change])])


def _carried(
    points: FloatArray, poses: FloatArray, bent: FloatArray, scale: FloatArray, anchor: IntArray
) -> FloatArray:
    """Points (n, 3) at the same place in the view of their frames ``anchor`` (n,), at the new scale."""
    old, new = poses[anchor], bent[anchor]
    in_camera = ((points - old[:, :3, 3])[:, None, :] @ old[:, :3, :3])[:, 0]
    moved = (new[:, :3, :3] @ (scale[anchor, None] * in_camera)[:, :, None])[:, :, 0]
    return np.asarray(moved + new[:, :3, 3])
