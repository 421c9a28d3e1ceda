"""Random landmarks with views, made so that every value differs."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.landmarks.model import DatabaseContents, Keyframe, LandmarkViews, Source
from vgps.model import Camera, GeodeticPoint

CAMERA = Camera(model="pinhole", width=320, height=240, fx=260.0, fy=255.0, cx=158.0, cy=121.0)
ORIGIN = GeodeticPoint(49.011, 8.4165, 163.0)


def random_poses(rng: np.random.Generator, count: int, spread_m: float = 20.0) -> np.ndarray:
    """Upright-ish cameras (count, 4, 4) looking about, near the origin."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.random(count, random_state=rng).as_matrix()
    poses[:, :3, 3] = rng.uniform(-spread_m, spread_m, (count, 3))
    return poses


def random_contents(
    seed: int = 0, landmarks: int = 60, max_views: int = 4, spread_m: float = 30.0, keyframes: int = 2
) -> DatabaseContents:
    """A small world of landmarks, each seen from random places by cameras that face it."""
    rng = np.random.default_rng(seed)
    count = rng.integers(1, max_views + 1, landmarks)
    owner = np.repeat(np.arange(landmarks), count)
    point = rng.uniform(-spread_m, spread_m, (landmarks, 3))
    direction = rng.normal(size=(len(owner), 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    distance = 2.0 ** rng.uniform(1.0, 6.0, (len(owner), 1))
    turn = Rotation.from_rotvec(rng.normal(scale=0.3, size=(len(owner), 3))).as_matrix()
    forward = -(turn @ direction[:, :, None])[:, :, 0]
    right = np.cross(forward, rng.normal(size=(len(owner), 3)))
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    views = LandmarkViews(
        landmark=3 * owner + 5,
        world_p_landmark=point[owner],
        world_p_camera=point[owner] + distance * direction,
        world_v_column=right * distance / 260.0,
        world_v_row=np.cross(forward, right) * distance / 255.0,
        templates=rng.integers(0, 256, (len(owner), 3, 5, 5), dtype=np.uint8),
        sigma_px=rng.uniform(0.3, 1.0, landmarks)[owner],
        position_sigma_m=rng.uniform(0.01, 0.5, landmarks)[owner],
    )
    keys = tuple(_keyframe(rng, views, pose) for pose in random_poses(rng, keyframes))
    return DatabaseContents(ORIGIN, views, keys, (Source("rec/wälk", "even", landmarks, '{"max_views":4}'),))


def _keyframe(rng: np.random.Generator, views: LandmarkViews, pose: np.ndarray) -> Keyframe:
    rows = np.sort(rng.choice(len(views), min(7, len(views)), replace=False))
    return Keyframe(
        world_T_camera=pose,
        landmark=views.landmark[rows],
        world_p_landmark=views.world_p_landmark[rows],
        descriptors=rng.integers(0, 256, (len(rows), 128), dtype=np.uint8),
        thumbnail=rng.integers(0, 256, (6, 8), dtype=np.uint8),
    )


def plane_normals(views):
    """Return the unit normals (N, 3) of the template planes, towards the camera of each view."""
    # columns run right and rows down in the image, so their product points away from the camera
    normal = -np.cross(views.world_v_column, views.world_v_row)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)
