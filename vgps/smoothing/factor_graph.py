"""Maps and fixes as one bundle problem, over a range of frames: the energy (11) of Kume 2010."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from factors import (
    constant_velocity_factor,
    control_point_factor,
    level_factor,
    projection_noise,
    projection_sigma_px,
    reliability_sigma_px,
)
from vgps.config import Config
from vgps.gps.fixes import Fixes, gps_graph
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS, ControlObservations
from vgps.mapping.local_map import LocalMap
from vgps.mapping.zero_motion import ZeroMotion
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.smoothing.context import SmoothingContext
from vgps.solution import Observations, Trajectory
from vgps.solver.cost import reprojection_errors, whitened_robust_k
from vgps.solver.problem import BundleProblem

_LEVEL_FRAMES = 20  # among which the one prior is shared out; how many does not change its weight
_POSITION_LIMIT = 1e5  # in map units: points further away are rounding


@dataclass(frozen=True)
class Scene:
    """What stages C and D optimise: frames with their times and poses, features, and constraints.

    Attributes:
        t_s: (F,) times of the frames.
        poses: (F, 4, 4) world_T_camera.
        points: (L, 3) positions of the features that have one.
        observations: Of these features in these frames.
        zero_motions: Frames held to another one because nothing moved; indices within these frames.
        controls: Observations of known points.
    """

    t_s: FloatArray
    poses: FloatArray
    points: FloatArray
    observations: Observations
    zero_motions: tuple[ZeroMotion, ...] = ()
    controls: ControlObservations = NO_CONTROL_OBSERVATIONS

    @property
    def trajectory(self) -> Trajectory:
        """The frames' poses over time."""
        return Trajectory(self.t_s, self.poses)


def scene_of_map(local_map: LocalMap, first: int, controls: ControlObservations) -> tuple[Scene, IntArray]:
    """Return the frames of a map from ``first`` on, and the features behind the rows of its points.

    Args:
        local_map: All its frames posed.
        first: Index of the first frame to take.
        controls: Observations of known points, of all frames.
    """
    log = local_map.observations(first)
    known = np.isfinite(local_map.points[log.landmark, 0])
    known &= np.isfinite(local_map.poses[log.frame - local_map.first_frame, 0, 0])
    ids, row = np.unique(log.landmark[known], return_inverse=True)
    observations = Observations(log.frame[known] - first, row, log.uv_px[known])
    constraints = tuple(
        ZeroMotion(held.frame - first, held.reference - first, held.reference_T_frame, held.sigma)
        for held in local_map.zero_motions
        if held.reference >= first
    )
    rows = slice(first - local_map.first_frame, None)
    poses = local_map.poses[rows]
    known_points = controls.between(first, first + len(poses) - 1)
    return Scene(
        local_map.t_s[rows], poses, local_map.points[ids], observations, constraints, known_points
    ), ids


def select_observations(
    scene: Scene, context: SmoothingContext, tolerance: float = 1.0
) -> tuple[Scene, FloatArray]:
    """Drop observations that contradict the scene, and compute the reliability of what is left.

    Observations with too large an error go, then features with too few observations or behind a camera. While
    the poses are still rough a larger ``tolerance``, in ``max_reprojection_px``, keeps what holds them
    together.

    Returns:
        The scene without them (rows of ``points`` unchanged), and reliabilities sigma_j (13) (L,) in pixels,
        NaN for features without an observation left.
    """
    config = context.config
    problem = _bare_problem(scene, context.K)
    error, behind = reprojection_errors(problem)
    good = ~behind & (np.linalg.norm(error, axis=1) < tolerance * config.mapping.max_reprojection_px)
    good &= np.abs(scene.points[scene.observations.landmark]).max(axis=1) < _POSITION_LIMIT
    views = np.bincount(scene.observations.landmark[good], minlength=len(scene.points))
    good &= views[scene.observations.landmark] >= config.mapping.min_views
    kept = _only(scene, good)
    sigma = reliability_sigma_px(
        error[good], kept.observations.landmark, len(scene.points), config.mapping.sigma_floor_px
    )
    return kept, sigma


def _only(scene: Scene, mask: BoolArray) -> Scene:
    old = scene.observations
    observations = Observations(old.frame[mask], old.landmark[mask], old.uv_px[mask])
    return replace(scene, observations=observations)


def _bare_problem(scene: Scene, K: FloatArray) -> BundleProblem:
    observations = scene.observations
    return BundleProblem(
        K=(K[0, 0], K[1, 1], K[0, 2], K[1, 2]),
        world_T_camera=scene.poses,
        world_p_landmark=scene.points,
        frame=observations.frame,
        landmark=observations.landmark,
        uv_px=observations.uv_px,
        sigma_px=np.ones(len(observations.frame)),
    )


def build_problem(
    scene: Scene,
    sigma_px: FloatArray,
    pose_graph: gtsam.NonlinearFactorGraph,
    context: SmoothingContext,
    fixed: BoolArray | None = None,
    shared: Mapping[int, FloatArray] | None = None,
) -> BundleProblem:
    """Return the energy (11): reprojection weighted by (12)(13), and ``pose_graph`` for everything else.

    Args:
        scene: Selected observations.
        sigma_px: (L,) reliabilities.
        pose_graph: Fixes, motion and priors.
        context: Calibration, weights and loss.
        fixed: (F,) frames to hold.
        shared: Start of the vectors that all frames share.
    """
    observations, config, K = scene.observations, context.config, context.K
    if config.batch.weight == "per_frame":
        sigma = projection_sigma_px(sigma_px, observations.landmark, observations.frame)
    else:
        sigma = sigma_px[observations.landmark]
    # the robust loss is in pixels, before any weighting between video and GPS
    sigma = sigma * config.batch.video_sigma_scale
    robust_k = whitened_robust_k(config.batch.robust_px, np.ones_like(sigma), sigma)
    return BundleProblem(
        K=(K[0, 0], K[1, 1], K[0, 2], K[1, 2]),
        world_T_camera=scene.poses,
        world_p_landmark=scene.points,
        frame=observations.frame,
        landmark=observations.landmark,
        uv_px=observations.uv_px,
        sigma_px=sigma,
        robust="huber",
        robust_k=robust_k,
        pose_graph=pose_graph,
        fixed=fixed,
        shared=shared or {},
    )


def motion_graph(scene: Scene, config: Config, speed_scale: float = 1.0) -> gtsam.NonlinearFactorGraph:
    """Return factors for frames without observations: zero motion for standing ones, else constant velocity.

    Args:
        scene: Selected observations.
        config: Densities of the motion noise.
        speed_scale: Map units per metre, for a map that has no scale yet.
    """
    graph = gtsam.NonlinearFactorGraph()
    frames = len(scene.t_s)
    held = np.bincount(scene.observations.frame, minlength=frames) > 0
    for constraint in scene.zero_motions:
        noise = gtsam.noiseModel.Diagonal.Sigmas(constraint.sigma)
        relative, reference, frame = (
            gtsam.Pose3(constraint.reference_T_frame),
            constraint.reference,
            constraint.frame,
        )
        graph.push_back(gtsam.BetweenFactorPose3(X(reference), X(frame), relative, noise))
        held[frame] = True
    for middle in _middles_around(np.flatnonzero(~held), frames):
        a, b, c = middle - 1, middle, middle + 1
        graph.push_back(
            constant_velocity_factor(
                (X(a), X(b), X(c)),
                (float(scene.t_s[b] - scene.t_s[a]), float(scene.t_s[c] - scene.t_s[b])),
                config.motion.rotation_density,
                config.motion.translation_density * speed_scale,
            )
        )
    return graph


def _middles_around(frames: IntArray, count: int) -> Sequence[int]:
    """Return the middle frames of all triples that contain one of ``frames``."""
    middles = np.unique((frames[:, None] + np.array([-1, 0, 1])).ravel())
    return [int(middle) for middle in middles if 1 <= middle <= count - 2]


def gps_and_motion(
    scene: Scene, fixes: Fixes, sensors: Sensors, context: SmoothingContext, n: int | None = None
) -> gtsam.NonlinearFactorGraph:
    """Return all factors on poses of a scene that lies in the world; the rest as for :func:`gps_graph`."""
    graph = gps_graph(fixes, scene.t_s, sensors, context.config.gps, n)
    graph.push_back(other_pose_factors(scene, sensors, context))
    return graph


def other_pose_factors(
    scene: Scene, sensors: Sensors, context: SmoothingContext
) -> gtsam.NonlinearFactorGraph:
    """Return all factors on poses but those of the fixes."""
    config = context.config
    graph = sensors.priors()
    graph.push_back(motion_graph(scene, config))
    graph.push_back(_upright(len(scene.t_s), config))
    graph.push_back(_known_points(scene.controls, context))
    return graph


def _known_points(controls: ControlObservations, context: SmoothingContext) -> gtsam.NonlinearFactorGraph:
    graph, K = gtsam.NonlinearFactorGraph(), context.K
    calibration = gtsam.Cal3_S2(K[0, 0], K[1, 1], 0.0, K[0, 2], K[1, 2])
    noise = projection_noise(context.config.start.control_sigma_px)
    for frame, uv, point in zip(controls.frame.tolist(), controls.uv_px, controls.world_p_point, strict=True):
        graph.push_back(control_point_factor(X(frame), uv, point, calibration, noise))
    return graph


def _upright(frames: int, config: Config) -> gtsam.NonlinearFactorGraph:
    """Return one prior of an upright camera, spread over some frames: its mounting is one unknown."""
    graph = gtsam.NonlinearFactorGraph()
    rows = np.unique(np.linspace(0, frames - 1, _LEVEL_FRAMES).astype(int))
    sigmas = np.radians([config.start.level_sigma_deg, config.start.pitch_sigma_deg]) * np.sqrt(len(rows))
    for row in rows.tolist():
        graph.push_back(level_factor(X(row), float(sigmas[0]), float(sigmas[1])))
    return graph
