"""A recording of a textured wall by a camera that moves along it, and the run it gives, known exactly."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation
from solutions import NORTH_R_CAMERA, make_landmarks, make_poses, make_solution

from vgps.camera import camera_fields, undistort
from vgps.model import Camera, GeodeticPoint
from vgps.readers.recording import open_recording
from vgps.solution import Observations, Solution
from vgps.writers.run_folder import write_run

ORIGIN = GeodeticPoint(49.011, 8.4165, 163.0)
PINHOLE = Camera(model="pinhole", width=320, height=240, fx=260.0, fy=255.0, cx=158.0, cy=121.0)
BENT = replace(PINHOLE, model="opencv", distortion=(-0.15, 0.04, 0.001, -0.001))
WALL_NORTH_M, TEXEL_M = 12.0, 0.03
FRAMES = 24


@dataclass(frozen=True)
class WallRun:
    """A recording folder, a run folder and what the run folder holds."""

    recording: Path
    run: Path
    solution: Solution


@cache
def texture() -> np.ndarray:
    """Corners everywhere, smooth enough to be sampled between pixels."""
    rng = np.random.default_rng(5)
    coarse = cv2.resize(rng.integers(30, 226, (90, 180), dtype=np.uint8), (1440, 720), interpolation=0)
    return cv2.GaussianBlur(coarse, (0, 0), 2.0)


def poses() -> np.ndarray:
    """(F, 4, 4) three metres along the wall, two towards it, turning a little."""
    share = np.linspace(0, 1, FRAMES)
    turn = Rotation.from_euler("yx", np.column_stack([6 * np.sin(4 * share), 4 * share]), degrees=True)
    positions = np.column_stack([3 * share - 1.5, 2 * share, 0.2 * share])
    return make_poses(positions, NORTH_R_CAMERA @ turn.as_matrix())


@cache
def camera_rays(camera: Camera) -> np.ndarray:
    """(H W, 3) the ray of every pixel of the lens's image."""
    v, u = np.mgrid[: camera.height, : camera.width]
    uv = undistort(camera, np.column_stack([u.ravel(), v.ravel()]))
    return np.column_stack([(uv - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(uv))])


def render(camera: Camera, pose: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """What the lens shows of the wall."""
    world = camera_rays(camera) @ pose[:3, :3].T
    point = pose[:3, 3] + (WALL_NORTH_M - pose[1, 3]) / world[:, 1:2] * world
    at = (point[:, [0, 2]] * (1, -1) / TEXEL_M + (wall.shape[1] / 2, wall.shape[0] / 2)).astype(np.float32)
    maps = at.reshape(camera.height, camera.width, 2)
    return cv2.remap(wall, maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)


def wall_solution(recording: Path, camera: Camera) -> Solution:
    """150 landmarks on the wall, seen without error wherever they are in the image."""
    rng = np.random.default_rng(6)
    points = np.column_stack([rng.uniform(-7, 7, 150), np.full(150, WALL_NORTH_M), rng.uniform(-5, 5, 150)])
    path = poses()
    camera_p = np.einsum("fij,fni->fnj", path[:, :3, :3], points[None] - path[:, None, :3, 3])
    uv = camera_p[..., :2] / camera_p[..., 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    seen = ((uv > 2) & (uv < (camera.width - 3, camera.height - 3))).all(axis=2)
    frame, landmark = np.nonzero(seen)
    return make_solution(
        t_s=np.arange(FRAMES) / 10,
        world_T_camera=path,
        recording=recording,
        world_origin=ORIGIN,
        camera=camera,
        landmarks=make_landmarks(points, sigma_px=rng.uniform(0.3, 0.6, 150)),
        observations=Observations(frame, landmark, uv[frame, landmark]),
    )


def make_wall_run(folder: Path, camera: Camera = PINHOLE) -> WallRun:
    """Write the recording and the run."""
    recording, wall = folder / "recording", texture()
    (recording / "images").mkdir(parents=True)
    for i, pose in enumerate(poses()):
        cv2.imwrite(str(recording / "images" / f"{i:03d}.png"), render(camera, pose, wall))
    times = "".join(f"{i},{i / 10}\n" for i in range(FRAMES))
    (recording / "images" / "frame_times.csv").write_text("frame,t_s\n" + times)
    lens = "".join(f"{name}: {value}\n" for name, value in camera_fields(camera).items())
    (recording / "camera.yaml").write_text(lens)
    solution = wall_solution(recording, camera)
    write_run(solution, folder / "run")
    assert open_recording(recording, with_gps=False).camera == camera
    return WallRun(recording, folder / "run", solution)
