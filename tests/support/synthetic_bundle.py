"""A short drive with tracked points, fixes and motion factors: bundle problems with a known truth."""

from collections.abc import Sequence
from dataclasses import replace

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.model import FloatArray
from vgps.solver.cost import cost_terms
from vgps.solver.levenberg_marquardt import SolverSettings
from vgps.solver.problem import BundleProblem, RobustLoss

K = (500.0, 510.0, 320.0, 240.0)
ANTENNA = np.array([0.1, -0.6, 0.3])  # camera_p_antenna
TIGHT = SolverSettings(relative_tolerance=1e-13, absolute_tolerance=1e-13)


def true_poses(frames: int) -> FloatArray:
    yaw = 0.3 * np.sin(np.arange(frames) / 12.0)
    step = np.stack([np.sin(yaw), 0.02 * np.cos(yaw), np.cos(yaw)], axis=1) * 0.6
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = [gtsam.Rot3.Ry(angle).matrix() for angle in yaw]
    poses[:, :3, 3] = np.cumsum(step, axis=0)
    return poses


def antenna_fix(frame: int, share: float, world_p_fix: FloatArray, sigma_m: float) -> gtsam.CustomFactor:
    """A Python factor for a fix between two frames, at ``share`` of the interval."""
    lever = ANTENNA.reshape(3, 1)

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: Sequence | None) -> FloatArray:
        residual = -world_p_fix
        for i, weight in enumerate((1.0 - share, share)):
            pose = values.atPose3(this.keys()[i])
            R = pose.rotation().matrix()
            residual = residual + weight * (pose.translation() + R @ ANTENNA)
            if jacobians is not None:
                by_rotation = -R @ gtsam.Rot3.Hat(lever.ravel())
                jacobians[i] = np.asfortranarray(weight * np.hstack([by_rotation, R]))
        return residual

    noise = gtsam.noiseModel.Isotropic.Sigma(3, sigma_m)
    return gtsam.CustomFactor(noise, [X(frame), X(frame + 1)], error)


def constant_velocity(frame: int, sigma_m: float) -> gtsam.CustomFactor:
    """A Python factor for three frames in a line at equal distances."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: Sequence | None) -> FloatArray:
        residual = np.zeros(3)
        for i, weight in enumerate((1.0, -2.0, 1.0)):
            pose = values.atPose3(this.keys()[i])
            residual = residual + weight * pose.translation()
            if jacobians is not None:
                R = pose.rotation().matrix()
                jacobians[i] = np.asfortranarray(weight * np.hstack([np.zeros((3, 3)), R]))
        return residual

    noise = gtsam.noiseModel.Isotropic.Sigma(3, sigma_m)
    return gtsam.CustomFactor(noise, [X(frame), X(frame + 1), X(frame + 2)], error)


def pose_factors(poses: FloatArray, rng: np.random.Generator) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    frames = len(poses)
    loose = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0]))
    for i in range(frames - 1):
        motion = gtsam.Pose3(poses[i]).between(gtsam.Pose3(poses[i + 1]))
        graph.add(gtsam.BetweenFactorPose3(X(i), X(i + 1), motion, loose))
    for i in range(frames - 2):
        graph.add(constant_velocity(i, 0.5))
    antenna = poses[:, :3, 3] + poses[:, :3, :3] @ ANTENNA
    for i in range(0, frames - 1, 4):
        between = 0.7 * antenna[i] + 0.3 * antenna[i + 1]
        graph.add(antenna_fix(i, 0.3, between + rng.normal(0.0, 0.03, 3), 0.05))
    return graph


def visible(
    poses: FloatArray, world_p_landmark: FloatArray, first: int, last: int
) -> tuple[FloatArray, FloatArray]:
    """Return the frames of first..last whose image contains the point, and its position in each."""
    frames = np.arange(max(first, 0), min(last, len(poses) - 1) + 1)
    R, t = poses[frames, :3, :3], poses[frames, :3, 3]
    p = np.einsum("fji,fj->fi", R, world_p_landmark - t)
    frames, p = frames[p[:, 2] > 1.0], p[p[:, 2] > 1.0]
    uv = np.stack([K[0] * p[:, 0] / p[:, 2] + K[2], K[1] * p[:, 1] / p[:, 2] + K[3]], axis=1)
    inside = np.all((uv > 0.0) & (uv < [640.0, 480.0]), axis=1)
    return frames[inside], uv[inside]


def drive(
    frames: int = 40, landmarks: int = 300, seed: int = 0, outliers: float = 0.0, disturbed: float = 1.0
) -> tuple[BundleProblem, FloatArray]:
    """Return a problem with a disturbed start, and its true poses; tracks have 3 to 25 frames.

    Args:
        frames: F.
        landmarks: L; those in fewer than three images have no observations.
        seed: Seed of all random numbers.
        outliers: Share of the observations displaced by up to 60 px.
        disturbed: Scale of the errors of the start: 0.2 deg, 0.1 m, landmarks 0.3 m.
    """
    rng = np.random.default_rng(seed)
    poses = true_poses(frames)
    points = np.zeros((landmarks, 3))
    rows: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for landmark in range(landmarks):
        first, length = int(rng.integers(0, frames - 1)), int(rng.integers(4, 26))
        depth = rng.uniform(6.0, 30.0)
        camera_p = depth * np.array([rng.uniform(-0.6, 0.6), rng.uniform(-0.4, 0.4), 1.0])
        points[landmark] = poses[first, :3, :3] @ camera_p + poses[first, :3, 3]
        seen, uv = visible(poses, points[landmark], first, first + length - 1)
        if len(seen) < 3:
            continue
        rows.append((seen, np.full(len(seen), landmark), uv))
    frame, landmark, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    uv = uv + rng.normal(0.0, 0.5, uv.shape)
    bad = rng.random(len(uv)) < outliers
    uv[bad] += rng.uniform(-60.0, 60.0, (int(bad.sum()), 2))
    shift = disturbed * rng.normal(size=(frames, 6)) * [0.0035, 0.0035, 0.0035, 0.1, 0.1, 0.1]
    start = np.stack([gtsam.Pose3(T).retract(d).matrix() for T, d in zip(poses, shift, strict=True)])
    shuffled = rng.permutation(len(frame))
    problem = BundleProblem(
        K=K,
        world_T_camera=start,
        world_p_landmark=points + disturbed * rng.normal(0.0, 0.3, points.shape),
        frame=frame[shuffled],
        landmark=landmark[shuffled],
        uv_px=uv[shuffled],
        sigma_px=rng.choice([2.0, 3.0, 5.0], landmarks)[landmark[shuffled]],
        pose_graph=pose_factors(poses, rng),
    )
    return problem, poses


def total_cost(problem: BundleProblem) -> float:
    return sum(cost_terms(problem).values())


def keep_observations(problem: BundleProblem, keep: FloatArray) -> BundleProblem:
    """Return the problem with some of its observations and all of its pose factors and vectors."""
    return replace(
        problem.select_observations(keep),
        pose_graph=problem.pose_graph,
        shared=problem.shared,
        states=problem.states,
    )


def with_loss(problem: BundleProblem, loss: RobustLoss, k: float = 1.0) -> BundleProblem:
    return replace(problem, robust=loss, robust_k=np.full(len(problem.frame), k))


def through_lens(problem: BundleProblem) -> BundleProblem:
    """The problem with errors that a lens stretches and turns, each by other amounts."""
    lens = np.eye(2) + np.random.default_rng(3).uniform(-0.6, 0.6, (len(problem.frame), 2, 2))
    return replace(problem, lens=lens)


def one_point(world_p: list[float], uv: list[float], **changes: object) -> BundleProblem:
    """Return a problem of one camera at the origin that observes one landmark."""
    arrays = {
        "world_T_camera": np.eye(4)[None],
        "world_p_landmark": np.array([world_p]),
        "frame": np.array([0]),
        "landmark": np.array([0]),
        "uv_px": np.array([uv]),
        "sigma_px": np.array([2.0]),
    }
    return BundleProblem(K=K, **(arrays | changes))


def views(problem: BundleProblem) -> np.ndarray:
    """Return the number of observations of each observation's landmark, (N,)."""
    return np.bincount(problem.landmark)[problem.landmark]


def interrupted_tracks() -> BundleProblem:
    """Return a drive of which frames 15 to 22 observe nothing."""
    problem, _ = drive()
    problem = keep_observations(problem, (problem.frame < 15) | (problem.frame > 22))
    return keep_observations(problem, views(problem) >= 3)


def held_frames() -> BundleProblem:
    """Return a drive whose first twelve frames and frame 30 are held, the former at their true poses."""
    problem, poses = drive()
    start = problem.world_T_camera.copy()
    start[:12] = poses[:12]
    return replace(problem, world_T_camera=start, fixed=np.isin(np.arange(40), [*range(12), 30]))


def sparse_tracks() -> BundleProblem:
    """Return a drive half of whose landmarks are observed in every third frame only."""
    problem, _ = drive()
    problem = keep_observations(problem, (problem.landmark % 2 == 0) | (problem.frame % 3 == 0))
    return keep_observations(problem, views(problem) >= 3)


def wrong_sign_factor() -> gtsam.NonlinearFactorGraph:
    """Return a factor with the wrong sign of its Jacobian: no step of the linear model lowers the cost."""

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: list | None) -> np.ndarray:
        if jacobians is not None:
            jacobians[0] = np.asfortranarray(np.hstack([np.zeros((3, 3)), -np.eye(3)]))
        return values.atPose3(this.keys()[0]).translation() - 10.0

    graph = gtsam.NonlinearFactorGraph()
    graph.add(gtsam.CustomFactor(gtsam.noiseModel.Unit.Create(3), [X(0)], error))
    return graph
