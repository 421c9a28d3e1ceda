"""With and without an IMU: tilt after a constant rotation."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solutions import make_solution

from scripts.benchmarks.imu import tilt
from vgps.solution import Trajectory


def test_tilt_leaves_out_a_constant_rotation_and_heading():
    t = np.arange(20) / 10
    true = np.tile(np.eye(4), (20, 1, 1))
    true[:, :3, :3] = Rotation.from_euler("z", 10.0 * np.arange(20)[:, None], degrees=True).as_matrix()
    truth = Trajectory(t, true)
    camera = Rotation.from_euler("x", 0.7, degrees=True).as_matrix()
    off = true.copy()
    off[:, :3, :3] = Rotation.from_euler("z", 2.0, degrees=True).as_matrix() @ true[:, :3, :3] @ camera
    angle, _ = tilt(make_solution(t, off), truth)
    assert angle == pytest.approx(0.0, abs=0.05)
    off[:, :3, :3] = Rotation.from_euler("x", 1.0, degrees=True).as_matrix() @ true[:, :3, :3]
    angle, _ = tilt(make_solution(t, off), truth)
    assert angle > 0.5
