"""Two laps of the same street: landmarks observed again after a long time make a band full."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X
from synthetic_bundle import K, visible

from vgps.solver.problem import BundleProblem

LAP = 72  # frames


def ring(laps: int) -> np.ndarray:
    """Return poses (F, 4, 4) on a circle of 30 m, looking ahead and out; the second lap is 0.4 m wider."""
    angle = 2 * np.pi * np.arange(laps * LAP) / LAP
    radius = 30.0 + 0.4 * (np.arange(laps * LAP) // LAP)
    poses = np.tile(np.eye(4), (laps * LAP, 1, 1))
    poses[:, :3, :3] = [gtsam.Rot3.Ry(-a - 0.2).matrix() for a in angle]
    poses[:, :3, 3] = np.stack(
        [radius * np.cos(angle), 0.1 * np.sin(3 * angle), radius * np.sin(angle)], axis=1
    )
    return poses


def two_laps(landmarks: int = 260, seed: int = 0) -> BundleProblem:
    """Return a problem with fixes whose landmarks are observed in one lap, and most of them in both."""
    rng = np.random.default_rng(seed)
    poses = ring(2)
    points, rows = np.zeros((landmarks, 3)), []
    for landmark in range(landmarks):
        first, length = int(rng.integers(0, LAP)), int(rng.integers(4, 9))
        ray = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), 1.0]) * rng.uniform(6.0, 20.0)
        points[landmark] = poses[first, :3, :3] @ ray + poses[first, :3, 3]
        for start in (first, first + LAP)[: 1 + int(rng.random() < 0.7)]:
            frames, uv = visible(poses, points[landmark], start, start + length)
            rows.append((frames, np.full(len(frames), landmark), uv))
    frame, landmark, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    keep = np.bincount(landmark, minlength=landmarks)[landmark] >= 3
    graph = gtsam.NonlinearFactorGraph()
    fix = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    for i in range(0, 2 * LAP, 12):
        graph.add(gtsam.GPSFactor(X(i), poses[i, :3, 3] + rng.normal(0, 0.1, 3), fix))
    loose = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0]))
    for i in range(2 * LAP - 1):
        motion = gtsam.Pose3(poses[i]).between(gtsam.Pose3(poses[i + 1]))
        graph.add(gtsam.BetweenFactorPose3(X(i), X(i + 1), motion, loose))
    shift = rng.normal(size=(2 * LAP, 6)) * [0.003, 0.003, 0.003, 0.1, 0.1, 0.1]
    start = np.stack([gtsam.Pose3(T).retract(d).matrix() for T, d in zip(poses, shift, strict=True)])
    noisy = uv[keep] + rng.normal(0, 0.5, uv[keep].shape)
    sigma = np.full(int(keep.sum()), 2.0)
    near = points + rng.normal(0, 0.2, points.shape)
    return BundleProblem(
        K=K,
        world_T_camera=start,
        world_p_landmark=near,
        frame=frame[keep],
        landmark=landmark[keep],
        uv_px=noisy,
        sigma_px=sigma,
        pose_graph=graph,
    )
