"""Bundle problems of a rig of two cameras with a known truth."""

import gtsam
import numpy as np
from synthetic_bundle import K, pose_factors, true_poses, visible

from vgps.model import FloatArray
from vgps.solver.mounts import CameraMounts
from vgps.solver.problem import BundleProblem

REAR_K = (350.0, 360.0, 300.0, 250.0)
REAR = gtsam.Pose3(gtsam.Rot3.RzRyRx(0.1, 2.8, -0.2), np.array([0.3, -0.1, -0.5])).matrix()


def rig_drive(
    frames: int = 30, landmarks: int = 200, seed: int = 0, noise_px: float = 0.5
) -> tuple[BundleProblem, FloatArray]:
    """Return a drive that a camera to the front and another to the rear observe, and the front's true poses.

    Tracks have 3 to 14 frames; the start is off by 0.2 deg, 0.1 m, and 0.3 m for landmarks.
    """
    rng = np.random.default_rng(seed)
    poses, points, rows = true_poses(frames), np.zeros((landmarks, 3)), []
    for landmark in range(landmarks):
        camera, first = landmark % 2, int(rng.integers(0, frames - 1))
        views = poses @ (REAR if camera else np.eye(4))
        depth = rng.uniform(6.0, 20.0)
        camera_p = depth * np.array([rng.uniform(-0.6, 0.6), rng.uniform(-0.4, 0.4), 1.0])
        points[landmark] = views[first, :3, :3] @ camera_p + views[first, :3, 3]
        seen, uv = visible(views, points[landmark], first - 6, first + 7)
        if camera:
            uv = (uv - K[2:]) / K[:2] * REAR_K[:2] + REAR_K[2:]
        if len(seen) >= 3:
            rows.append((seen, np.full(len(seen), landmark), uv))
    frame, landmark, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    shift = rng.normal(size=(frames, 6)) * [0.0035, 0.0035, 0.0035, 0.1, 0.1, 0.1]
    start = np.stack([gtsam.Pose3(T).retract(d).matrix() for T, d in zip(poses, shift, strict=True)])
    mounts = CameraMounts(
        camera=landmark % 2, K=np.array([K, REAR_K]), reference_T_camera=np.stack([np.eye(4), REAR])
    )
    problem = BundleProblem(
        K=K,
        world_T_camera=start,
        world_p_landmark=points + rng.normal(0.0, 0.3, points.shape),
        frame=frame,
        landmark=landmark,
        uv_px=uv + noise_px * rng.normal(size=uv.shape),
        sigma_px=np.full(len(frame), 2.0),
        pose_graph=pose_factors(poses, rng),
        mounts=mounts,
    )
    return problem, poses
