"""GTSAM graphs of a short drive, of every kind that the solver reads."""

from dataclasses import replace

import gtsam
import numpy as np
from gtsam.noiseModel import mEstimator
from gtsam.symbol_shorthand import X
from synthetic_bundle import ANTENNA, K, drive, with_loss

from factors import Cylinder, Gaussian, gps_factor, gps_factor_interpolated
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.problem import BundleProblem

POSE_NOISE = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.01, 0.01, 0.01, 0.1, 0.1, 0.1]))
CAMERA = gtsam.Cal3_S2(K[0], K[1], 0.0, K[2], K[3])
Graph = tuple[gtsam.NonlinearFactorGraph, gtsam.Values]


def small_problem(**changes) -> BundleProblem:
    return drive(frames=24, landmarks=150, **changes)[0]


def plain_graph() -> Graph:
    """Return a graph with priors, motion, fixes between frames and constant velocity, in C++ and Python."""
    graph, values = to_graph(small_problem())
    graph.addPriorPose3(X(0), values.atPose3(X(0)), POSE_NOISE)
    return graph, values


def huber_graph() -> Graph:
    problem, _ = drive(outliers=0.05)
    return to_graph(with_loss(problem, "huber"))


def cauchy_graph() -> Graph:
    problem, _ = drive(outliers=0.05, disturbed=0.3)
    return to_graph(with_loss(problem, "cauchy", 1.5))


def partly_robust_graph() -> Graph:
    """Return a graph half of whose projections have no loss."""
    problem = small_problem()
    k = np.where(problem.landmark % 2 == 0, np.inf, 1.0)
    return to_graph(replace(problem, robust="huber", robust_k=k))


def graph_with_points_behind() -> Graph:
    """Return a graph some of whose landmarks are behind all cameras."""
    problem = small_problem()
    points = problem.world_p_landmark.copy()
    points[::30] = [0.0, 0.0, -80.0]
    return to_graph(replace(problem, world_p_landmark=points))


def graph_with_fixes() -> Graph:
    """Return a graph with fixes of a cylinder and of a robust Gaussian penalty, with a lever arm."""
    problem = small_problem()
    graph, values = to_graph(problem)
    truth = drive(frames=24, landmarks=150)[1]
    antenna = truth[:, :3, 3] + truth[:, :3, :3] @ ANTENNA
    for i in range(0, 24, 3):
        graph.push_back(gps_factor(X(i), antenna[i] + [0.05, 0, 0], ANTENNA, Cylinder(0.2, 0.3, 2, 0.5)))
    robust = Gaussian((0.1, 0.1, 0.2), cauchy_k=1.0)
    for i in range(1, 22, 5):
        between = 0.5 * (antenna[i] + antenna[i + 1])
        graph.push_back(gps_factor_interpolated((X(i), X(i + 1)), 0.5, between, ANTENNA, robust))
    return graph, values


def graph_with_held_poses() -> Graph:
    """Return a graph whose first pose is held by an equality, the second by a constrained prior."""
    graph, values = to_graph(small_problem())
    graph.push_back(gtsam.NonlinearEqualityPose3(X(0), values.atPose3(X(0))))
    graph.addPriorPose3(X(1), values.atPose3(X(1)), gtsam.noiseModel.Constrained.All(6))
    return graph, values


def graph_with_known_points() -> Graph:
    """Return a graph some of whose landmarks have priors, two observations in a frame, or other models."""
    graph, values = to_graph(small_problem())
    points = [key for key in list(values.keys()) if gtsam.Symbol(key).chr() == ord("l")]
    tight = gtsam.noiseModel.Isotropic.Sigma(3, 0.02)
    for key in points[:3]:
        graph.addPriorPoint3(key, values.atPoint3(key) + 0.05, tight)
    noise = gtsam.noiseModel.Isotropic.Sigma(2, 2.0)
    first = next(
        f for f in map(graph.at, range(graph.size())) if isinstance(f, gtsam.GenericProjectionFactorCal3_S2)
    )
    graph.push_back(
        gtsam.GenericProjectionFactorCal3_S2(first.measured() + 1.0, noise, *first.keys(), CAMERA)
    )
    wild = gtsam.noiseModel.Robust.Create(mEstimator.Tukey.Create(8.0), noise)
    pose = values.atPose3(X(5))
    seen = [k for k in points[10:] if (pose.transformTo(values.atPoint3(k)))[2] > 3.0][:2]
    other = gtsam.Cal3_S2(450.0, 450.0, 1.0, 300.0, 250.0)
    for key, model, camera in ((seen[0], wild, CAMERA), (seen[1], noise, other)):
        uv = gtsam.PinholeCameraCal3_S2(pose, camera).project(values.atPoint3(key)) + 1.0
        graph.push_back(gtsam.GenericProjectionFactorCal3_S2(uv, model, X(5), key, camera))
    return graph, values


def graph_with_other_keys() -> Graph:
    """Return a graph with keys of poses that are not x0, x1, ..., after those of the landmarks."""
    graph, values = to_graph(small_problem())
    names = {X(i): gtsam.symbol("q", 7 * i + 3) for i in range(24)}
    names |= {
        key: gtsam.symbol("a", 2 * gtsam.Symbol(key).index())
        for key in list(values.keys())
        if key not in names
    }
    renamed, there = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for i in range(graph.size()):
        factor = graph.at(i)
        if not isinstance(factor, gtsam.CustomFactor):  # these cannot be renamed
            renamed.push_back(factor.rekey([names[key] for key in list(factor.keys())]))
    poses = gtsam.utilities.allPose3s(values)
    for key in list(values.keys()):
        there.insert(names[key], values.atPose3(key) if poses.exists(key) else values.atPoint3(key))
    fix = gps_factor(names[X(4)], values.atPose3(X(4)).translation(), np.zeros(3), Cylinder(0.1, 0.1, 1, 0.5))
    renamed.push_back(fix)
    renamed.addPriorPose3(names[X(0)], there.atPose3(names[X(0)]), POSE_NOISE)
    return renamed, there


def graph_with_shuffled_keys(frames: int = 24) -> Graph:
    """Return a graph in which frames that follow each other have keys far apart."""
    problem, _ = drive(frames=frames, landmarks=6 * frames)
    place = np.random.default_rng(1).permutation(frames)
    graph, values = to_graph(replace(problem, pose_graph=gtsam.NonlinearFactorGraph()))
    renamed, there = gtsam.NonlinearFactorGraph(), gtsam.Values(values)
    names = {X(i): X(int(place[i])) for i in range(frames)}
    for factor in map(graph.at, range(graph.size())):
        renamed.push_back(factor.rekey([names.get(key, key) for key in list(factor.keys())]))
    noise = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    loose = gtsam.noiseModel.Isotropic.Sigma(6, 1.0)
    for i in range(frames):
        pose = values.atPose3(X(i))
        there.update(names[X(i)], pose)
        renamed.push_back(gtsam.GPSFactor(names[X(i)], pose.translation(), noise))
        renamed.push_back(gtsam.PriorFactorPose3(names[X(i)], pose, loose))
    return renamed, there
