"""A short drive with tracked points, fixes and motion factors: bundle problems with a known truth."""

from collections.abc import Sequence

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X

from vgps.model import FloatArray
from vgps.solver.problem import BundleProblem

K = (500.0, 510.0, 320.0, 240.0)
ANTENNA = np.array([0.1, -0.6, 0.3])  # camera_p_antenna


def true_poses(frames: int) -> FloatArray:
    yaw = 0.3 * np.sin(np.arange(frames) / 12.0)
    step = np.stack([np.sin(yaw), 0.02 * np.cos(yaw), np.cos(yaw)], axis=1) * 0.6
    poses = np.tile(np.eye(4), (frames, 1, 1))
    poses[:, :3, :3] = [gtsam.Rot3.Ry(angle).matrix() for angle in yaw]
    poses[:, :3, 3] = np.cumsum(step, axis=0)
    return poses


def antenna_fix(frame: int, share: float, world_p_fix: FloatArray, sigma_m: float) -> gtsam.CustomFactor:
    """A fix at its own time, ``share`` of the way from a frame to the next, in Python."""
    lever = ANTENNA.reshape(3, 1)

    def error(this: gtsam.CustomFactor, values: gtsam.Values, jacobians: Sequence | None) -> FloatArray:
        residual = -world_p_fix
        for i, weight in enumerate((1.0 - share, share)):
            pose = values.atPose3(this.keys()[i])
            R = pose.rotation().matrix()
            residual = residual + weight * (pose.translation() + R @ ANTENNA)
            if jacobians is not None:
                turned = -R @ gtsam.Rot3.Hat(lever.ravel())
                jacobians[i] = np.asfortranarray(weight * np.hstack([turned, R]))
        return residual

    noise = gtsam.noiseModel.Isotropic.Sigma(3, sigma_m)
    return gtsam.CustomFactor(noise, [X(frame), X(frame + 1)], error)


def constant_velocity(frame: int, sigma_m: float) -> gtsam.CustomFactor:
    """Three frames in a line at equal distances."""

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
    turn = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0]))
    for i in range(frames - 1):
        motion = gtsam.Pose3(poses[i]).between(gtsam.Pose3(poses[i + 1]))
        graph.add(gtsam.BetweenFactorPose3(X(i), X(i + 1), motion, turn))
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
    """Frames of first..last that see the point inside the image, and where."""
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
    """A disturbed problem, and its true poses; tracks of 3 to 25 frames.

    Args:
        frames: F.
        landmarks: L, those without three views in the image left out of the observations.
        seed: Of everything random.
        outliers: Share of the observations displaced by up to 60 px.
        disturbed: Scale of the start's errors: 0.2 deg, 0.1 m, points 0.3 m.
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
