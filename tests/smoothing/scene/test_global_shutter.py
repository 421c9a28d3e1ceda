"""Observations of a rolling shutter, moved to the times of their frames."""

from dataclasses import replace

import numpy as np
from synthetic_bundle import K
from synthetic_rows import ROWS, rolling_drive

from vgps.model import Camera
from vgps.smoothing.scene.global_shutter import as_global_shutter
from vgps.smoothing.scene.scene import Scene
from vgps.solution import Observations
from vgps.solver.cost import reprojection_errors

READOUT_S = 0.06
CAMERA = Camera(
    model="pinhole", width=640, height=ROWS, fx=K[0], fy=K[1], cx=K[2], cy=K[3], readout_s=READOUT_S
)


def test_observations_agree_with_their_frames_poses() -> None:
    problem, poses = rolling_drive(READOUT_S, noise_px=0.0, disturbed=0.0)
    t_s = 0.1 * np.arange(len(poses)) + 0.004 * np.sin(np.arange(len(poses)))
    observations = Observations(problem.frame, problem.landmark, problem.uv_px)
    scene = Scene(t_s, poses, problem.world_p_landmark, observations)
    moved = as_global_shutter(scene, CAMERA).observations
    before, after = (
        np.linalg.norm(reprojection_errors(replace(problem, uv_px=uv_px, row_times=None))[0], axis=1)
        for uv_px in (problem.uv_px, moved.uv_px)
    )
    # rows come from the observations, which the drive has moved by some pixels of 480
    assert np.median(before) > 1.0 and np.median(after) < 0.02 * np.median(before)
    assert as_global_shutter(scene, replace(CAMERA, readout_s=None)) is scene
