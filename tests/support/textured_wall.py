"""A textured wall seen by a moving camera: exact poses, gyro, blur, and a landmark database in memory."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from vgps.landmarks.descriptors import describe
from vgps.landmarks.model import Cameras, Keyframe, LandmarkViews, Source
from vgps.model import Camera, Frame, GeodeticPoint, GyroLog, Recording, Rig

CAMERA = Camera(model="pinhole", width=320, height=240, fx=300.0, fy=300.0, cx=160.0, cy=120.0)
METRES = 0.02  # of a pixel of the texture
WALL_M = 10.0  # the wall stands at z = 10, the camera looks along z
FPS = 10.0
ORIGIN = GeodeticPoint(49.0, 8.4, 160.0)
GYRO_R_CAMERA = Rotation.from_euler("xyz", [90, 5, -3], degrees=True).as_matrix()


@cache
def wall() -> np.ndarray:
    """The texture, (1400, 2400)."""
    rng = np.random.default_rng(0)
    parts = [cv2.GaussianBlur(rng.normal(size=(1400, 2400)), (0, 0), sigma) * sigma for sigma in (1.5, 4, 12)]
    sum_ = sum(part / part.std() for part in parts)
    return np.clip(128 + 30 * sum_, 0, 255).astype(np.float32)


def rotation_at(t_s: float | np.ndarray, turn_deg_s: float = 40.0) -> Rotation:
    w = np.radians(turn_deg_s)
    angles = [0.08 * w * np.sin(8 * t_s), w / 6 * np.sin(6 * t_s), 0.05 * w * np.sin(5 * t_s + 1)]
    return Rotation.from_euler("xyz", np.stack(angles, axis=-1))


def pose_at(t_s: float, turn_deg_s: float = 40.0) -> np.ndarray:
    """A camera that moves sideways at 0.8 m/s and towards the wall at 0.3 m/s, and shakes."""
    pose = np.eye(4)
    pose[:3, :3] = rotation_at(t_s, turn_deg_s).as_matrix()
    pose[:3, 3] = (-1 + 0.8 * t_s, 0.1 * np.sin(t_s), 0.3 * t_s)
    return pose


def wall_to_image(pose: np.ndarray) -> np.ndarray:
    """(3, 3) homography from pixels of the texture to pixels of the image."""
    height, width = wall().shape
    origin = np.array([-width * METRES / 2, -height * METRES / 2, WALL_M])
    plane = np.column_stack([[METRES, 0, 0], [0, METRES, 0], origin - pose[:3, 3]])
    return CAMERA.K @ pose[:3, :3].T @ plane


def picture(pose: np.ndarray) -> np.ndarray:
    size = (CAMERA.width, CAMERA.height)
    return cv2.warpPerspective(wall(), wall_to_image(pose), size, flags=cv2.INTER_AREA)


def exposed(t_s: float, exposure_s: float, turn_deg_s: float = 40.0) -> np.ndarray:
    times = t_s + exposure_s * (np.arange(12) + 0.5 - 6) / 12
    return np.mean([picture(pose_at(t, turn_deg_s)) for t in times], axis=0).astype(np.float32)


def rolling(t_s: float, readout_s: float, turn_deg_s: float = 40.0) -> np.ndarray:
    """A picture whose rows were exposed one after the other."""
    rows = np.arange(CAMERA.height)
    times = t_s + readout_s * (rows / (CAMERA.height - 1) - 0.5)
    to_wall = np.linalg.inv([wall_to_image(pose_at(t, turn_deg_s)) for t in times])
    pixels = np.stack(np.broadcast_arrays(np.arange(CAMERA.width)[None], rows[:, None], 1), axis=-1)
    at = np.einsum("vij,vuj->vui", to_wall, pixels)
    return cv2.remap(wall(), (at[..., :2] / at[..., 2:]).astype(np.float32), None, cv2.INTER_LINEAR)


def gyro(duration_s: float, bias: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> GyroLog:
    """200 Hz, from half a second before the first frame to half a second after the last."""
    step = 0.005
    t = np.arange(-0.5, duration_s + 0.5, step)
    rates = (rotation_at(t - 1e-4).inv() * rotation_at(t + 1e-4)).as_rotvec() / 2e-4
    return GyroLog(t, rates @ GYRO_R_CAMERA.T + bias, Path("gyro.csv"))


def views_from(pose: np.ndarray, count: int = 150, first_id: int = 0) -> LandmarkViews:
    """Corners of the picture that a camera takes, with templates at three levels."""
    image = picture(pose)
    corners = cv2.goodFeaturesToTrack(image, count, 0.01, 12)[:, 0].astype(float)
    inner = ((corners > 32) & (corners < np.array([CAMERA.width, CAMERA.height]) - 33)).all(axis=1)
    uv = corners[inner]
    rays = np.column_stack([(uv - (160, 120)) / 300.0, np.ones(len(uv))])
    depth = (WALL_M - pose[2, 3]) / (rays @ pose[:3, :3].T)[:, 2]
    points = (rays * depth[:, None]) @ pose[:3, :3].T + pose[:3, 3]
    step = np.arange(-7, 8)
    levels = []
    for k in range(3):
        smooth = image if k == 0 else cv2.GaussianBlur(image, (0, 0), 0.5 * 2**k)
        at_u = np.float32(uv[:, 0, None, None] + step[None, None, :] * 2**k + 0 * step[None, :, None])
        at_v = np.float32(uv[:, 1, None, None] + step[None, :, None] * 2**k + 0 * step[None, None, :])
        flat = cv2.remap(smooth, at_u.reshape(len(uv), -1), at_v.reshape(len(uv), -1), cv2.INTER_LINEAR)
        levels.append(np.round(flat).astype(np.uint8).reshape(-1, 15, 15))
    n = len(uv)
    return LandmarkViews(
        landmark=np.arange(n) + first_id,
        world_p_landmark=points,
        world_p_camera=np.tile(pose[:3, 3], (n, 1)),
        world_v_column=depth[:, None] / 300.0 * pose[:3, 0],
        world_v_row=depth[:, None] / 300.0 * pose[:3, 1],
        templates=np.stack(levels, axis=1),
        sigma_px=np.full(n, 0.3),
        position_sigma_m=np.full(n, 0.01),
    )


@dataclass
class WallDatabase:
    """The interface of a landmark database over views taken by cameras in front of the wall."""

    path: Path = Path("wall.db")
    world_origin: GeodeticPoint | None = ORIGIN
    cameras: Cameras | None = None

    def __post_init__(self) -> None:
        places = [(x, y) for x in (-3.0, -1.0, 1.0, 3.0) for y in (-0.5, 0.5)]
        parts = []
        for k, (x, y) in enumerate(places):
            pose = np.eye(4)
            pose[:3, 3] = (x, y, 0.2)
            parts.append(views_from(pose, first_id=1000 * k))
        self._parts = parts
        names = list(LandmarkViews.__dataclass_fields__)
        self.all_views = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}

    def views(self, pose, camera, *, max_landmarks=None, max_depth_m=None):
        camera_p = (self.all_views["world_p_landmark"] - pose[:3, 3]) @ pose[:3, :3]
        uv = camera_p[:, :2] / camera_p[:, 2:] * 300.0 + (160, 120)
        seen = np.flatnonzero((camera_p[:, 2] > 1) & (uv > 0).all(axis=1) & (uv < (320, 240)).all(axis=1))
        if max_landmarks is not None and len(seen) > max_landmarks:
            seen = seen[np.linspace(0, len(seen) - 1, max_landmarks).astype(int)]
        return LandmarkViews(**{name: values[seen] for name, values in self.all_views.items()})

    def sources(self):
        return (Source("wall", "all", len(self.all_views["landmark"]), "{}", self.cameras),)

    def keyframes(self):
        out = []
        for part in self._parts:
            pose = np.eye(4)
            pose[:3, 3] = part.world_p_camera[0]
            image = np.clip(picture(pose), 0, 255).astype(np.uint8)
            uv, descriptors = describe(image, 4000)
            camera_p = part.world_p_landmark - pose[:3, 3]
            at = camera_p[:, :2] / camera_p[:, 2:] * 300.0 + (160, 120)
            distance = np.linalg.norm(uv[:, None] - at[None], axis=2)
            near = distance.argmin(axis=1)
            kept = distance[np.arange(len(uv)), near] < 2
            row = near[kept]
            out.append(
                Keyframe(
                    world_T_camera=pose,
                    landmark=part.landmark[row],
                    world_p_landmark=part.world_p_landmark[row],
                    descriptors=descriptors[kept],
                    thumbnail=image[::8, ::8],
                )
            )
        return tuple(out)


@dataclass
class WallVideo:
    """A video of the wall; frames in ``black`` show nothing. With a readout nothing is blurred."""

    count: int
    exposure_s: float = 0.05
    black: tuple[int, ...] = ()
    turn_deg_s: float = 40.0
    readout_s: float = 0.0
    path: Path = Path("wall.mp4")
    width: int = CAMERA.width
    height: int = CAMERA.height

    @property
    def times_s(self) -> np.ndarray:
        return np.arange(self.count) / FPS

    def frames(self):
        for i, t in enumerate(self.times_s):
            if self.readout_s:
                image = rolling(t, self.readout_s, self.turn_deg_s)
            else:
                image = exposed(t, self.exposure_s, self.turn_deg_s)
            shown = np.full_like(image, 16) if i in self.black else image
            yield Frame(i, float(t), np.round(shown).astype(np.uint8))


def recording_of(video: WallVideo, bias: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Recording:
    """A recording of the wall with its exposure and a gyro."""
    rig = Rig(gyro_R_camera=GYRO_R_CAMERA, exposure_s=video.exposure_s)
    log = gyro(video.count / FPS, bias)
    return Recording(path=Path("wall"), video=video, camera=CAMERA, rig=rig, gyro=log)
