"""Stage C, Kume 2010: sliding-window optimisation of the last frames of a map, older ones held."""

from dataclasses import dataclass

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.config import Config
from vgps.gps.antenna_path import antenna_offsets, place
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.model import FloatArray
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.factor_graph import build_problem, gps_and_motion, select_observations
from vgps.smoothing.scene.motion_factors import motion_factors
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.scene.stops import with_stops, without_stops
from vgps.smoothing.stage_c.bending import bending_of
from vgps.smoothing.stage_c.held_scale import held_distance
from vgps.solution import Trajectory
from vgps.solver.bundle_adjustment import SolverSettings, solve

_HELD_SIGMA = 1e-4  # rad and map units: a frame that is held


@dataclass(frozen=True)
class WindowResult:
    """New poses and positions, unchanged if ``converged`` is false: no step lowered the cost."""

    update: MapUpdate
    converged: bool


def optimise_window(
    local_map: LocalMap,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    context: SmoothingContext,
    tolerance: float = 1.0,
) -> WindowResult:
    """Optimise the poses of the last frames and the features observed in them.

    Older frames that share features with the window are held as if they were exact; they alone carry earlier
    information, mainly scale and position, into the window. Frames of a stop do not count, or none of those
    held would have moved after a long one, which leaves the scale open. This is faster than iSAM2
    (``scripts.benchmarks.stage_c``), but held frames may be wrong, for which :func:`contradicts` tests the
    fixes. A map that begins in the window is constrained by fixes or control points if it is aligned; without
    them its scale is held by how far its farthest frame is from the first, and as it may be bent, its windows
    take more steps.

    Args:
        local_map: The map; it is not changed.
        fixes: Fixes so far, with the time offset removed.
        camera_p_antenna: (3,) metres.
        context: Calibration, control points, window, weights and GPS model.
        tolerance: Limit of the initial reprojection error in ``max_reprojection_px``; larger if the poses are
            rough.

    Raises:
        GeometryError: The poses are so far off that the cost is not finite.
        RuntimeError: GTSAM cannot linearise a factor there.
    """
    config = context.config
    length, history = config.window.length_frames, local_map.views.shape[1]
    since = max(local_map.first_posed, local_map.last_moving(length))
    first = max(local_map.first_posed, local_map.last_moving(length + history))
    whole, ids = scene_of_map(local_map, first, context.controls)
    scene, rows = without_stops(whole)
    scene, sigma = select_observations(scene, context, tolerance)
    fixed = rows < since - first
    if local_map.aligned:
        graph = gps_and_motion(scene, fixes, Sensors.fixed(camera_p_antenna), context)
    else:
        speed = _typical_speed(scene.trajectory)
        torn = scene.torn(config.tracking.min_inliers)
        graph = motion_factors(scene, scene.unseen, torn, config.motion, speed)
    tied = local_map.aligned and (config.gps.model != "none" or len(scene.controls.frame) > 0)
    if starts := not fixed.any():
        graph.push_back(start_priors(scene.poses, local_map.aligned, tied))
    problem = build_problem(scene, np.nan_to_num(sigma, nan=1.0), graph, context, fixed)
    may_bend = starts and not tied
    rough = may_bend or tolerance > 1.0
    settings = SolverSettings(
        max_iterations=config.window.iterations * (config.window.rough_factor if rough else 1),
        relative_tolerance=config.batch.early_tolerance if may_bend else config.batch.relative_tolerance,
    )
    solved = solve(problem, settings)
    result, reliable = solved.problem, np.isfinite(sigma)
    positions = Positions(ids[reliable], result.world_p_landmark[reliable], sigma[reliable])
    bending = None
    if not tied:  # else fixes straighten it
        bending = np.full(len(whole.t_s), np.nan)
        bending[rows] = bending_of(result)
    poses = with_stops(whole, rows, result.world_T_camera)
    update = MapUpdate(first_frame=first, poses=poses, bending=bending, positions=positions)
    return WindowResult(update, not solved.stuck)


def contradicts(
    local_map: LocalMap,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    whole: bool = False,
) -> bool:
    """Return whether fixes of the last window are so far off that the older, held frames must be wrong.

    They are if one is farther outside its region than odometry drifts over the distance, or if the mean
    offset of all of them exceeds their mean region.

    Args:
        local_map: Aligned map.
        fixes, camera_p_antenna, config: As in :func:`optimise_window`.
        whole: Whether to test the whole map instead of its last window.
    """
    begin = 0 if whole else local_map.last_moving(config.window.length_frames)
    first = max(local_map.first_posed, begin) - local_map.first_frame
    path = Trajectory(local_map.t_s[first:], local_map.poses[first:])
    if config.gps.model == "none" or len(path) < 2:
        return False
    rows = place(path.t_s, fixes.t_s).inside & fixes.used
    offset = antenna_offsets(fixes, path, camera_p_antenna)[rows]
    beyond = np.maximum(
        np.hypot(offset[:, 0], offset[:, 1]) - fixes.r_m[rows], np.abs(offset[:, 2]) - fixes.h_m[rows]
    )
    window_m = path.length_m * min(1.0, config.window.length_frames / len(path))
    if (beyond > config.window.tolerated_drift * window_m).any():
        return True
    if rows.sum() < config.window.min_shared_fixes:
        return False
    # an offset common to all fixes is an error of the path, which the held frames would preserve
    shared = offset.mean(axis=0)
    return bool(np.hypot(*shared[:2]) > fixes.r_m[rows].mean() or abs(shared[2]) > fixes.h_m[rows].mean())


def _typical_speed(path: Trajectory) -> float:
    return float(max(path.length_m / max(path.t_s[-1] - path.t_s[0], 1e-9), 1e-6))


def start_priors(poses: FloatArray, aligned: bool, tied: bool, first: int = 0) -> gtsam.NonlinearFactorGraph:
    """Return what holds a map whose first frame is in the window.

    Args:
        poses: (F, 4, 4) of the frames of the window.
        aligned: Whether the map's world is that of the fixes; else its first frame is held.
        tied: Whether fixes or control points give its place and scale; else the scale is held.
        first: Number of the first frame, in its key.
    """
    # on a straight path fixes do not determine the roll; this keeps the system positive definite
    sigmas = np.array([0.1, 0.1, 0.1, 100.0, 100.0, 100.0]) if aligned else np.full(6, _HELD_SIGMA)
    graph = gtsam.NonlinearFactorGraph()
    graph.addPriorPose3(X(first), gtsam.Pose3(poses[0]), gtsam.noiseModel.Diagonal.Sigmas(sigmas))
    if not tied:
        farthest = int(np.argmax(np.linalg.norm(poses[:, :3, 3] - poses[0, :3, 3], axis=1)))
        graph.push_back(held_distance(poses, 0, farthest, first))
    return graph
