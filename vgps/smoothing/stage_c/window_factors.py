"""Factors of stage C by iSAM2: what enters and what leaves the smoother with a window."""

from collections.abc import KeysView
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from gtsam.noiseModel import mEstimator
from gtsam.symbol_shorthand import L, X

from factors import gps_factor_interpolated
from vgps.config import BatchConfig, GpsConfig
from vgps.geometry import largest_angle_rad, world_rays
from vgps.gps.antenna_path import place
from vgps.gps.fix_factors import contributing_fixes, penalty
from vgps.gps.fixes import Fixes
from vgps.lens_jacobian import lens_jacobian
from vgps.model import FloatArray, IntArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.control_factors import control_factors, control_sigma_px
from vgps.smoothing.scene.motion_factors import motion_factors
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_c.fixed_lag import FixedLagGraph, GraphChange, Name

_MIN_PARALLAX_RAD = np.radians(1.0)
"""A point enters once its rays differ by this: with less, Gauss-Newton's steps go astray along the rays."""
_POINT_SIGMA = 30.0
"""Standard deviation of a new point's prior, as a share of its distance. It keeps a point determined whose
projections leave. A tight one would hold the map's scale: a thousand points with a sigma of 1 to 3 %."""


@dataclass(frozen=True, kw_only=True)
class WindowScene:
    """Frames of a window, and those before it that share features with them.

    Attributes:
        scene: Frames from ``offset`` on with selected observations; ``feature`` (L,) numbers of its points,
            ``sigma_px`` (L,) their reliabilities.
        offset: Frame of the scene's first row.
        begin: First frame that is in the smoother, or will be.
        since: First frame of the window; those before it leave.
        new: First frame that is not in the smoother yet.
    """

    scene: Scene
    feature: IntArray
    sigma_px: FloatArray
    offset: int
    begin: int
    since: int
    new: int

    @property
    def frame(self) -> IntArray:
        """(N,) frame of each observation."""
        return self.scene.observations.frame + self.offset

    @property
    def newest(self) -> int:
        """The newest frame."""
        return self.offset + len(self.scene.t_s) - 1

    @property
    def starts(self) -> bool:
        """Whether the smoother is still empty."""
        return self.new == self.begin

    def pose(self, frame: int) -> FloatArray:
        """Return the pose (4, 4) of a frame."""
        return np.asarray(self.scene.poses[frame - self.offset])


def projection_change(window: WindowScene, graph: FixedLagGraph, context: SmoothingContext) -> GraphChange:
    """Return the projections that enter or leave, and the points that they bring.

    A point enters once its rays have parallax; a projection enters with the reliability that its point has
    then, and leaves if it no longer agrees. In the first window older frames are held: their projections
    have points as their only variables.
    """
    scene, frame, landmark = window.scene, window.frame, window.scene.observations.landmark
    last = np.full(len(scene.points), -1)
    np.maximum.at(last, landmark, frame)
    known = np.array([L(number) in graph for number in window.feature.tolist()], dtype=bool)
    joins = ~known & (last >= window.since) & (_parallax_rad(window, context) >= _MIN_PARALLAX_RAD)
    wanted = (known | joins)[landmark] & (frame >= window.begin)
    wanted |= joins[landmark] & window.starts
    rows = np.flatnonzero(wanted)
    names: list[Name] = list(zip(frame[rows].tolist(), window.feature[landmark[rows]].tolist(), strict=True))
    change = GraphChange(removed=_withdrawn(graph.names(), set(names), window.begin))
    for point in np.unique(landmark[rows]).tolist():
        change.stamps[L(int(window.feature[point]))] = float(last[point])
    _add_points(change, window, np.intersect1d(np.flatnonzero(joins), landmark[rows]), last)
    fresh = [k for k, name in enumerate(names) if name not in graph.names()]
    _add_projections(change, window, rows[fresh], context)
    return change


def _parallax_rad(window: WindowScene, context: SmoothingContext) -> FloatArray:
    """Return the largest angle between the rays of each point, (L,); 0 for one without observations."""
    seen = window.scene.observations
    order = np.lexsort((seen.frame, seen.landmark))
    rays = world_rays(context.K, window.scene.poses[seen.frame[order]], seen.uv_px[order])
    points, start = np.unique(seen.landmark[order], return_index=True)
    parallax = np.zeros(len(window.scene.points))
    parallax[points] = largest_angle_rad(rays, start)
    return parallax


def _withdrawn(present: KeysView[Name], wanted: set[Name], begin: int) -> set[Name]:
    """Return the projections in the smoother's frames that are no longer wanted."""
    return {name for name in present - wanted if isinstance(name[0], int) and name[0] >= begin}


def _add_points(change: GraphChange, window: WindowScene, points: IntArray, last: IntArray) -> None:
    scene = window.scene
    to_point = scene.points[points] - scene.poses[last[points] - window.offset, :3, 3]
    distances = np.linalg.norm(to_point, axis=1).tolist()
    for point, distance in zip(points.tolist(), distances, strict=True):
        number, position = int(window.feature[point]), scene.points[point]
        noise = gtsam.noiseModel.Isotropic.Sigma(3, _POINT_SIGMA * distance)
        change.values.insert(L(number), position)
        change.factors["point", number] = gtsam.PriorFactorPoint3(L(number), position, noise)


def _add_projections(
    change: GraphChange, window: WindowScene, rows: IntArray, context: SmoothingContext
) -> None:
    observations, K = window.scene.observations, context.K
    calibration = gtsam.Cal3_S2(K[0, 0], K[1, 1], 0.0, K[0, 2], K[1, 2])
    lens = lens_jacobian(context.camera, observations.uv_px[rows])
    shapes = np.broadcast_to(np.eye(2), (len(rows), 2, 2)) if lens is None else lens
    sigmas = window.sigma_px[observations.landmark[rows]].tolist()
    noises = [_pixel_noise(*one, context.config.batch) for one in zip(sigmas, shapes, strict=True)]
    numbers = window.feature[observations.landmark[rows]].tolist()
    for k, number, noise, frame in zip(
        rows.tolist(), numbers, noises, window.frame[rows].tolist(), strict=True
    ):
        uv = observations.uv_px[k]
        factor: gtsam.NonlinearFactor
        if frame < window.begin:
            camera = gtsam.PinholeCameraCal3_S2(gtsam.Pose3(window.pose(frame)), calibration)
            factor = gtsam.TriangulationFactorCal3_S2(camera, uv, noise, L(number))
        else:
            keys = X(frame), L(number)
            factor = gtsam.GenericProjectionFactorCal3_S2(uv, noise, *keys, calibration, False, False)
        change.factors[frame, number] = factor


def _pixel_noise(sigma_px: float, lens: FloatArray, config: BatchConfig) -> gtsam.noiseModel.Robust:
    """Return the noise of a projection through a lens (2, 2): Huber's loss in pixels, as in stage D."""
    sigma = sigma_px * config.video_sigma_scale
    pixels = gtsam.noiseModel.Gaussian.SqrtInformation(lens / sigma)
    return gtsam.noiseModel.Robust.Create(mEstimator.Huber.Create(config.robust_px / sigma), pixels)


def fix_change(
    window: WindowScene, graph: FixedLagGraph, fixes: Fixes, camera_p_antenna: FloatArray, config: GpsConfig
) -> GraphChange:
    """Return the fixes that enter, late ones too, and those that leave because their verdict has changed.

    A fix is named by its time, its place and its region, so that one with another region replaces it.
    """
    t_s = window.scene.t_s[window.begin - window.offset :]
    rows = np.flatnonzero(contributing_fixes(fixes, t_s, config))
    placement = place(t_s, fixes.t_s)
    columns = np.column_stack([fixes.t_s, fixes.world_p_fix, fixes.r_m, fixes.h_m])[rows]
    names: list[Name] = [("fix", *column) for column in columns.tolist()]
    change = GraphChange(removed={name for name in graph.names() if name[0] == "fix"} - set(names))
    for name, row in zip(names, rows.tolist(), strict=True):
        if name not in graph.names():
            k, alpha = window.begin + int(placement.frame[row]), float(placement.alpha[row])
            cost, fix = penalty(fixes, row, config), fixes.world_p_fix[row]
            factor = gps_factor_interpolated((X(k), X(k + 1)), alpha, fix, camera_p_antenna, cost)
            change.factors[name] = factor
    return change


def frame_change(window: WindowScene, context: SmoothingContext) -> GraphChange:
    """Return the new frames, with what holds them beside features and fixes: standing still, control points.

    The zero motions of ``window.scene`` count from ``window.offset``.
    """
    change, config, scene, offset = GraphChange(), context.config, window.scene, window.offset
    for frame in range(window.new, window.newest + 1):
        change.values.insert(X(frame), gtsam.Pose3(window.pose(frame)))
        change.stamps[X(frame)] = float(frame)
    motions = tuple(
        replace(one, frame=one.frame + offset, reference=one.reference + offset)
        for one in scene.zero_motions
        if one.frame + offset >= window.new and one.reference + offset >= window.begin
    )
    none = np.zeros(len(scene.t_s), dtype=bool)  # an unseen frame is not for iSAM2, tears are for stage D
    factors = motion_factors(replace(scene, zero_motions=motions), none, none[1:], config.motion)
    controls = context.controls.between(window.new, window.newest)
    sigma_px = control_sigma_px(
        controls, scene.poses[window.new - offset :], context.K, config.start.control_sigma_px
    )
    controls = replace(controls, frame=controls.frame + window.new)
    factors.push_back(control_factors(controls, sigma_px, context.K))
    for k in range(factors.size()):
        change.factors["frame", window.new, k] = factors.at(k)
    return change
