"""A bundle problem as a GTSAM factor graph, for GTSAM's own optimiser and as a reference."""

from typing import Any

import gtsam
import numpy as np
from gtsam.noiseModel import mEstimator
from gtsam.symbol_shorthand import L

from factors import RowTime, rolling_projection_factor
from vgps.solver.gtsam_values import pose_values
from vgps.solver.problem import BundleProblem
from vgps.solver.row_times import RowTimes


def to_graph(problem: BundleProblem) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Return the problem as a factor graph, and the values of the variables that occur in it.

    Landmarks have the keys ``l<row>``. Held poses get a constrained prior, which costs nothing there.
    """
    graph = gtsam.NonlinearFactorGraph(problem.pose_graph)
    keys = problem.keys
    if problem.row_times is None:
        frames = problem.frame
        graph.push_back(_projections(problem))
    else:
        frames = problem.row_times.knots
        graph.push_back(_rolling_projections(problem, problem.row_times))
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


def _mounted(problem: BundleProblem) -> list[tuple[gtsam.Pose3, gtsam.Cal3_S2]]:
    """Return the pose on the rig and the calibration of each camera."""
    mounts = problem.mounts
    if mounts is None or mounts.reference_T_camera is None:
        return [(gtsam.Pose3(), _calibration(*problem.K))]
    poses = [gtsam.Pose3(mount) for mount in mounts.reference_T_camera]
    return [(T, _calibration(*K)) for T, K in zip(poses, mounts.K.tolist(), strict=True)]


def _calibration(fx: float, fy: float, cx: float, cy: float) -> gtsam.Cal3_S2:
    return gtsam.Cal3_S2(fx, fy, 0.0, cx, cy)


def _projections(problem: BundleProblem) -> gtsam.NonlinearFactorGraph:
    """Return the projections from the frames' poses."""
    graph = gtsam.NonlinearFactorGraph()
    owners, landmarks = problem.keys[problem.frame].tolist(), problem.landmark.tolist()
    arguments: list[tuple[Any, ...]] = [(K, False, False) for _, K in _mounted(problem)]
    lenses = arguments * len(owners)
    if problem.mounts is not None:
        arguments = [(K, False, False, T) for T, K in _mounted(problem)]
        lenses = [arguments[camera] for camera in problem.mounts.camera.tolist()]
    rows = zip(problem.uv_px, _noise_models(problem), owners, landmarks, lenses, strict=True)
    for uv, model, key, point, lens in rows:
        graph.push_back(gtsam.GenericProjectionFactorCal3_S2(uv, model, key, L(point), *lens))
    return graph


def _rolling_projections(problem: BundleProblem, times: RowTimes) -> gtsam.NonlinearFactorGraph:
    """Return the projections of a rolling shutter, each from its row's pose."""
    graph = gtsam.NonlinearFactorGraph()
    cameras = [gtsam.PinholeCameraCal3_S2(T, K) for T, K in _mounted(problem)]
    camera = np.zeros(len(problem.frame), int) if problem.mounts is None else problem.mounts.camera
    keys, share, frame_s = problem.keys[times.knots].tolist(), times.share.tolist(), times.frame_s.tolist()
    for n, (point, noise) in enumerate(zip(problem.landmark.tolist(), _noise_models(problem), strict=True)):
        row = RowTime(times.knot_s[n], frame_s[n], share[n])
        uv = problem.uv_px[n]
        lens = cameras[camera[n]]
        graph.push_back(rolling_projection_factor(keys[n], L(point), uv, row, lens, noise, times.readout_s))
    return graph


def _noise_models(problem: BundleProblem) -> list[gtsam.noiseModel.Base]:
    """Return the noise model of each observation; observations with equal numbers share one."""
    k = np.full_like(problem.sigma_px, np.inf) if problem.robust_k is None else problem.robust_k
    numbers = [problem.sigma_px[:, None], k[:, None]]
    if problem.lens is not None:
        numbers.append((problem.lens / problem.sigma_px[:, None, None]).reshape(-1, 4))
    distinct, row = np.unique(np.hstack(numbers), axis=0, return_inverse=True)
    models: list[gtsam.noiseModel.Base] = []
    for sigma, constant, *lens in distinct.tolist():
        model: gtsam.noiseModel.Base = gtsam.noiseModel.Isotropic.Sigma(2, sigma)
        if lens:
            model = gtsam.noiseModel.Gaussian.SqrtInformation(np.reshape(lens, (2, 2)), False)
        if problem.robust != "none" and np.isfinite(constant):
            estimator = mEstimator.Huber if problem.robust == "huber" else mEstimator.Cauchy
            model = gtsam.noiseModel.Robust.Create(estimator.Create(constant), model)
        models.append(model)
    return [models[i] for i in row.ravel().tolist()]
