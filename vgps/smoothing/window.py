"""Stage C, Kume 2010: optimise the last frames of a map, with what is older held."""

from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.config import Config
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.gps.sensors import Sensors
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.factor_graph import (
    build_problem,
    gps_and_motion,
    motion_graph,
    scene_of_map,
    select_observations,
)
from vgps.solution import Trajectory
from vgps.solver.bundle_adjustment import SolverSettings, solve


@dataclass(frozen=True)
class WindowResult:
    """New poses and positions, and whether the optimiser found a way down; if not they are as they were."""

    update: MapUpdate
    converged: bool


def optimise_window(
    local_map: LocalMap,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    context: SmoothingContext,
    tolerance: float = 1.0,
) -> WindowResult:
    """Optimise the poses of the last frames and the features seen in them.

    Older frames that share features with the window are held: what was learnt before, scale and place above
    all, reaches the window through them alone, as if they were exact. Measured against iSAM2 and its fixed
    lag this is faster and as near to the truth (``scripts.benchmarks.window``), but what is held can be
    wrong: :func:`contradicts` asks the fixes. A map that begins in the window is held by GPS if it lies in
    the world, else by its first two posed frames.

    Args:
        local_map: The map; it is not changed.
        fixes: Fixes so far, in time.
        camera_p_antenna: (3,) metres.
        context: Calibration, control points, window, weights and GPS model.
        tolerance: Limit of observations that contradict the start, in ``max_reprojection_px``: more where it
            is rough.

    Raises:
        GeometryError: The poses are so far off that the cost is not finite.
        RuntimeError: GTSAM cannot linearise a factor there.
    """
    config = context.config
    since = max(local_map.first_posed, local_map.next_frame - config.window.length_frames)
    history = local_map.views.shape[1]
    first = max(local_map.first_posed, since - history)
    scene, ids = scene_of_map(local_map, first, context.controls)
    scene, sigma = select_observations(scene, context, tolerance)
    fixed = np.arange(len(scene.t_s)) < since - first
    if local_map.aligned:
        graph = gps_and_motion(scene, fixes, Sensors.fixed(camera_p_antenna), context)
        if not fixed.any():
            graph.push_back(_loose_prior(scene.poses[0]))
    else:
        graph = motion_graph(scene, config, _typical_speed(scene.trajectory))
        if not fixed.any():
            fixed[[0, _farthest_of_first_views(scene.poses)]] = True
    problem = build_problem(scene, np.nan_to_num(sigma, nan=1.0), graph, context, fixed)
    settings = SolverSettings(
        max_iterations=config.window.iterations * (1 if tolerance == 1.0 else config.window.rough_factor),
        relative_tolerance=config.batch.relative_tolerance,
    )
    solved = solve(problem, settings)
    result, reliable = solved.problem, np.isfinite(sigma)
    positions = Positions(ids[reliable], result.world_p_landmark[reliable], sigma[reliable])
    update = MapUpdate(first_frame=first, poses=result.world_T_camera, positions=positions)
    return WindowResult(update, not solved.stuck)


def contradicts(
    local_map: LocalMap,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    whole: bool = False,
) -> bool:
    """Return whether fixes of the last window lie so far off that the older frames must be wrong as well.

    They do where one lies farther outside its region than a camera drifts over the distance, or where all
    together lie to one side of the path by more than their regions.

    Args:
        local_map: Aligned.
        fixes, camera_p_antenna, config: As in :func:`optimise_window`.
        whole: Look at the whole map instead of its last window.
    """
    begin = 0 if whole else local_map.next_frame - config.window.length_frames
    first = max(local_map.first_posed, begin) - local_map.first_frame
    path = Trajectory(local_map.t_s[first:], local_map.poses[first:])
    if config.gps.model == "none" or len(path) < 2:
        return False
    placement = place(path.t_s, fixes.t_s)
    rows = placement.inside & fixes.used
    offset = (antenna_at(path.world_T_camera, placement, camera_p_antenna) - fixes.world_p_fix)[rows]
    beyond = np.maximum(
        np.hypot(offset[:, 0], offset[:, 1]) - fixes.r_m[rows], np.abs(offset[:, 2]) - fixes.h_m[rows]
    )
    window_m = path.length_m * min(1.0, config.window.length_frames / len(path))
    if (beyond > config.window.tolerated_drift * window_m).any():
        return True
    if rows.sum() < config.window.min_shared_fixes:
        return False
    # a small offset that all fixes share is none of theirs: the held frames would keep it for good
    shared = offset.mean(axis=0)
    return bool(np.hypot(*shared[:2]) > fixes.r_m[rows].mean() or abs(shared[2]) > fixes.h_m[rows].mean())


def _farthest_of_first_views(poses: FloatArray, views: int = 10) -> int:
    away = np.linalg.norm(poses[:views, :3, 3] - poses[0, :3, 3], axis=1)
    return int(np.argmax(away))


def _typical_speed(path: Trajectory) -> float:
    return float(max(path.length_m / max(path.t_s[-1] - path.t_s[0], 1e-9), 1e-6))


def _loose_prior(pose: FloatArray) -> gtsam.PriorFactorPose3:
    # fixes alone leave a straight track free to roll; a few degrees keep the system definite
    sigmas = np.array([0.1, 0.1, 0.1, 100.0, 100.0, 100.0])
    return gtsam.PriorFactorPose3(X(0), gtsam.Pose3(pose), gtsam.noiseModel.Diagonal.Sigmas(sigmas))
