"""The energy (11) of Kume 2010 over a range of frames, as a bundle problem."""

from dataclasses import replace

import gtsam
import numpy as np

from factors import projection_sigma_px, reliability_sigma_px
from vgps.config import Config
from vgps.gps.fix_factors import gps_graph
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.imu.states import ImuStates
from vgps.model import BoolArray, FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.control_factors import control_factors, control_sigma_px
from vgps.smoothing.scene.frame_rates import turned_back
from vgps.smoothing.scene.level_priors import level_priors
from vgps.smoothing.scene.loop_ties import fitting_loops
from vgps.smoothing.scene.motion_factors import motion_factors
from vgps.smoothing.scene.rig_views import observation_lenses, observation_times
from vgps.smoothing.scene.scene import Scene
from vgps.solver.cost import reprojection_errors, whitened_robust_k
from vgps.solver.problem import BundleProblem

_POSITION_LIMIT = 1e5  # map units; the depth of points farther away is rounding error


def select_observations(
    scene: Scene, context: SmoothingContext, tolerance: float = 1.0
) -> tuple[Scene, FloatArray]:
    """Select the observations that agree with the scene, and compute the reliabilities of their features.

    Observations with too large an error or behind the camera are dropped, then features with too few
    observations.

    Args:
        scene: The scene.
        context: Calibration and limits.
        tolerance: Limit of the error in ``max_reprojection_px``; larger while the poses are still rough.

    Returns:
        The scene without them and without loops that do not fit (rows of ``points`` unchanged), and
        reliabilities sigma_j (13) (L,) in pixels, NaN for features without an observation left.
    """
    config = context.config
    problem = _bare_problem(scene, context)
    error, behind = reprojection_errors(problem)
    squared = error[:, 0] ** 2
    squared += error[:, 1] ** 2
    good = ~behind & (np.sqrt(squared) < tolerance * config.mapping.max_reprojection_px)
    del squared  # memory counts here: arrays of a long recording's observations
    good &= (np.abs(scene.points).max(axis=1) < _POSITION_LIMIT)[scene.observations.landmark]
    tracked = np.ones_like(good)
    if scene.loop is not None:
        good, tracked = fitting_loops(good, ~behind, scene.loop, tolerance > 1.0), scene.loop < 0
    views = np.bincount(scene.observations.landmark[good & tracked], minlength=len(scene.points))
    good &= views[scene.observations.landmark] >= config.mapping.min_views
    of_track = good & tracked
    error = error[of_track]
    sigma = reliability_sigma_px(
        error,
        scene.observations.landmark[of_track],
        len(scene.points),
        config.mapping.sigma_floor_px,
    )
    return scene.with_observations(good), sigma


def _bare_problem(scene: Scene, context: SmoothingContext) -> BundleProblem:
    """Return the observations of a scene, each with a sigma of one pixel, and no other factors."""
    observations, K = scene.observations, context.K
    problem = BundleProblem(
        K=(K[0, 0], K[1, 1], K[0, 2], K[1, 2]),
        world_T_camera=scene.poses,
        world_p_landmark=scene.points,
        frame=observations.frame,
        landmark=observations.landmark,
        uv_px=observations.uv_px,
        sigma_px=np.broadcast_to(1.0, len(observations.frame)),
        lens=observation_lenses(observations, context, scene.rig),
        row_times=observation_times(scene.t_s, observations, context, scene.rig),
        mounts=None if scene.rig is None else scene.rig.mounts(observations.landmark, context),
    )
    return turned_back(problem, scene.rates)


def build_problem(
    scene: Scene,
    sigma_px: FloatArray,
    pose_graph: gtsam.NonlinearFactorGraph,
    context: SmoothingContext,
    fixed: BoolArray | None = None,
) -> BundleProblem:
    """Return the energy (11): reprojection errors weighted by (12)(13), and all other terms in
    ``pose_graph``.

    Args:
        scene: The scene with selected observations.
        sigma_px: (L,) reliabilities.
        pose_graph: Fixes, motion and priors.
        context: Calibration, weights and loss.
        fixed: (F,) frames to hold.
    """
    observations, config = scene.observations, context.config
    if config.batch.weight == "per_frame":
        sigma = projection_sigma_px(sigma_px, observations.landmark, observations.frame)
    else:
        sigma = sigma_px[observations.landmark]
    # the robust loss is in pixels, before any weighting between video and GPS
    sigma = sigma * config.batch.video_sigma_scale
    robust_k = whitened_robust_k(config.batch.robust_px, np.ones_like(sigma), sigma)
    return replace(
        _bare_problem(scene, context),
        sigma_px=sigma,
        robust="huber",
        robust_k=robust_k,
        pose_graph=pose_graph,
        fixed=fixed,
    )


def gps_and_motion(
    scene: Scene, fixes: Fixes, sensors: Sensors, context: SmoothingContext
) -> gtsam.NonlinearFactorGraph:
    """Return all factors on the poses of an aligned scene, errors of the fixes taken as independent."""
    config, controls, K = context.config, scene.controls, context.K
    sigma_px = control_sigma_px(controls, scene.poses, K, config.start.control_sigma_px)
    graph = gps_graph(fixes, scene.t_s, sensors, config.gps)
    return joined(graph, other_pose_factors(scene, sensors, config), control_factors(controls, sigma_px, K))


def joined(*graphs: gtsam.NonlinearFactorGraph) -> gtsam.NonlinearFactorGraph:
    """Return a graph with the factors of all graphs."""
    graph = gtsam.NonlinearFactorGraph()
    for one in graphs:
        graph.push_back(one)
    return graph


def other_pose_factors(
    scene: Scene, sensors: Sensors, config: Config, imu: ImuStates | None = None
) -> gtsam.NonlinearFactorGraph:
    """Return the factors of sensors, motion and a level camera: all but those of fixes and control points.

    With an IMU, its knots bridge frames without features, and constant velocity holds those between its knots
    that lost theirs. What is level is assumed beside gravity, too: until the camera turns, a bias of the
    accelerometer looks like a tilt.
    """
    fewest = config.tracking.min_inliers
    unseen, carried = scene.unseen, None
    if imu is not None:
        unseen = scene.hardly_seen(fewest)
        unseen[imu.frame] = False
        carried = np.isin(np.arange(len(scene.t_s)), imu.frame[imu.carried])
    motion = motion_factors(scene, unseen, scene.torn(fewest), config.motion, carried=carried)
    level = level_priors(np.arange(len(scene.t_s)), config.start, scene.ground)
    heights = gtsam.NonlinearFactorGraph() if scene.heights is None else scene.heights.graph()
    return joined(sensors.priors(), motion, level, heights)
