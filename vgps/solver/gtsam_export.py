"""A bundle problem as a GTSAM factor graph, for GTSAM's own optimiser and as a reference."""

import gtsam
import numpy as np
from gtsam.noiseModel import mEstimator
from gtsam.symbol_shorthand import L

from factors import RowTime, rolling_projection_factor
from vgps.solver.problem import BundleProblem, pose_values
from vgps.solver.row_times import RowTimes


def to_graph(problem: BundleProblem) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Return the problem as a factor graph, and the values of the variables that occur in it.

    Landmarks have the keys ``l<row>``. Held poses get a constrained prior, which costs nothing there.
    """
    K = gtsam.Cal3_S2(problem.K[0], problem.K[1], 0.0, problem.K[2], problem.K[3])
    graph = gtsam.NonlinearFactorGraph(problem.pose_graph)
    keys, landmarks = problem.keys, problem.landmark.tolist()
    if problem.row_times is None:
        frames, owners = problem.frame, keys[problem.frame].tolist()
        rows = zip(problem.uv_px, _noise_models(problem), owners, landmarks, strict=True)
        for uv, model, key, point in rows:
            graph.push_back(gtsam.GenericProjectionFactorCal3_S2(uv, model, key, L(point), K, False, False))
    else:
        frames = problem.row_times.knots
        graph.push_back(_rolling_projections(problem, problem.row_times, K))
    values = pose_values(problem)
    for frame in np.setdiff1d(frames, problem.pose_graph_frames).tolist():
        values.insert(int(keys[frame]), gtsam.Pose3(problem.world_T_camera[frame]))
    for row in np.unique(problem.landmark).tolist():
        values.insert(L(row), problem.world_p_landmark[row])
    held = gtsam.noiseModel.Constrained.All(6)
    for key in keys[problem.fixed_frames].tolist():
        if values.exists(key):
            graph.addPriorPose3(key, values.atPose3(key), held)
    return graph, values


def _rolling_projections(
    problem: BundleProblem, times: RowTimes, K: gtsam.Cal3_S2
) -> gtsam.NonlinearFactorGraph:
    """Return the projections of a rolling shutter, each from its row's pose."""
    graph = gtsam.NonlinearFactorGraph()
    keys, share, frame_s = problem.keys[times.knots].tolist(), times.share.tolist(), times.frame_s.tolist()
    for n, (point, noise) in enumerate(zip(problem.landmark.tolist(), _noise_models(problem), strict=True)):
        row = RowTime(times.knot_s[n], frame_s[n], share[n])
        uv = problem.uv_px[n]
        graph.push_back(rolling_projection_factor(keys[n], L(point), uv, row, K, noise, times.readout_s))
    return graph


def _noise_models(problem: BundleProblem) -> list[gtsam.noiseModel.Base]:
    """Return the noise model of each observation; observations with equal numbers share one."""
    k = np.full_like(problem.sigma_px, np.inf) if problem.robust_k is None else problem.robust_k
    pairs, row = np.unique(np.stack([problem.sigma_px, k], axis=1), axis=0, return_inverse=True)
    models: list[gtsam.noiseModel.Base] = []
    for sigma, constant in pairs.tolist():
        model: gtsam.noiseModel.Base = gtsam.noiseModel.Isotropic.Sigma(2, sigma)
        if problem.robust != "none" and np.isfinite(constant):
            estimator = mEstimator.Huber if problem.robust == "huber" else mEstimator.Cauchy
            model = gtsam.noiseModel.Robust.Create(estimator.Create(constant), model)
        models.append(model)
    return [models[i] for i in row.ravel().tolist()]
