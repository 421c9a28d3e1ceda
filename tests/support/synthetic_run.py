"""A recording of a textured wall by a camera that moves along it, and the run it gives, known exactly."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

from vgps.camera import camera_fields, undistort
from vgps.model import Camera, GeodeticPoint
from vgps.readers.recording import open_recording
from vgps.solution import (
    FrameState,
    Landmarks,
    Observations,
    SensorReport,
    Solution,
    SolverReport,
)
from vgps.writers.run_folder import write_run

ORIGIN = GeodeticPoint(49.011, 8.4165, 163.0)
PINHOLE = Camera("pinhole", 320, 240, 260.0, 255.0, 158.0, 121.0)
BENT = Camera("opencv", 320, 240, 260.0, 255.0, 158.0, 121.0, (-0.15, 0.04, 0.001, -0.001))
WALL_NORTH_M, TEXEL_M = 12.0, 0.03
FRAMES = 24
NORTH_R_CAMERA = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # looks north


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
    out = np.tile(np.eye(4), (FRAMES, 1, 1))
    share = np.linspace(0, 1, FRAMES)
    turn = Rotation.from_euler("yx", np.column_stack([6 * np.sin(4 * share), 4 * share]), degrees=True)
    out[:, :3, :3] = NORTH_R_CAMERA @ turn.as_matrix()
    out[:, :3, 3] = np.column_stack([3 * share - 1.5, 2 * share, 0.2 * share])
    return out


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
    nothing = np.full((FRAMES, 3), 0.01)
    return Solution(
        recording=recording,
        world_origin=ORIGIN,
        georeferenced=True,
        t_s=np.arange(FRAMES) / 10,
        world_T_camera=path,
        sigma_rotation_rad=nothing,
        sigma_position_m=nothing,
        state=(FrameState.TRACKED,) * FRAMES,
        camera=camera,
        camera_p_antenna=np.zeros(3),
        landmarks=Landmarks(points, rng.uniform(0.3, 0.6, 150), np.full(150, 128, np.uint8)),
        observations=Observations(frame, landmark, uv[frame, landmark]),
        gps=None,
        fixes=None,
        sensors=SensorReport(0.0, float("nan"), (float("nan"),) * 3),
        report=SolverReport({"video": 1.0}, {"video": 1.0}, 1, "made so"),
        seconds={},
        warnings=(),
        config={},
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
