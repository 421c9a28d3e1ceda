"""Runs with every lens model, and their exports."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.camera import project
from vgps.model import Camera
from vgps.solution import FrameState, Landmarks, Observations
from vgps.writers.export import ExportOptions, export
from vgps.writers.run_folder import write_run

PINHOLE = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.5, cy=241.0)


LENSES = {
    "pinhole": PINHOLE,
    "opencv": replace(PINHOLE, model="opencv", distortion=(-0.2, 0.05, 1e-3, -5e-4)),
    "opencv5": replace(PINHOLE, model="opencv", distortion=(-0.2, 0.05, 1e-3, -5e-4, 0.01)),
    "fisheye": replace(PINHOLE, model="fisheye", fx=400.0, fy=400.0, distortion=(0.03, -0.01, 2e-3, -1e-3)),
    "tsai": replace(PINHOLE, model="tsai", distortion=(1e-3, 2e-5), pixel_mm=(0.0075, 0.0071)),
}


def consistent(solution, camera, noise_px=0.5):
    """The fixture's run with five frames, forty points, and observations that are half a pixel off."""
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (5, 1, 1))
    turns = rng.normal(-90, 3, (5, 3)) * [1, 0, 0]
    poses[:, :3, :3] = Rotation.from_euler("xyz", turns, degrees=True).as_matrix()
    poses[:, :3, 3] = np.arange(5)[:, None] * [0.1, 0.5, 0.0]
    points = np.column_stack([rng.uniform(-3, 3, 40), rng.uniform(8, 20, 40), rng.uniform(-2, 2, 40)])
    frame, landmark = np.repeat(np.arange(5), 40), np.tile(np.arange(40), 5)
    offset = points[landmark] - poses[frame, :3, 3]
    p = (offset[:, None] @ poses[frame, :3, :3])[:, 0]
    pinhole = replace(camera, model="pinhole", distortion=())
    uv = project(pinhole, p) + rng.normal(0, noise_px, (200, 2))
    n = (5, 3)
    return replace(
        solution,
        camera=camera,
        t_s=np.arange(5.0),
        world_T_camera=poses,
        sigma_rotation_rad=np.ones(n),
        sigma_position_m=np.ones(n),
        state=(FrameState.TRACKED,) * 5,
        landmarks=Landmarks(points, np.full(40, 0.5), np.arange(40, dtype=np.uint8)),
        observations=Observations(frame, landmark, uv),
        world_p_before=None,
        graph=None,
    ), np.linalg.norm(uv - project(pinhole, p), axis=1).mean()


def exported(solution, tmp_path, to, name, **options):
    write_run(solution, tmp_path / "run")
    export(tmp_path / "run", to, tmp_path / name, ExportOptions(**options))
    return tmp_path / name
