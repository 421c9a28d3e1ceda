"""With and without an IMU: tilt after a constant rotation."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solutions import make_solution

from scripts.common.path_angles import motion_deg, tilt
from scripts.experiments.imu_sigmas import bias_ratios, by_chance, figures
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


def test_directions_of_motion_are_compared_in_the_cameras_axes():
    true = np.tile(np.eye(4), (31, 1, 1))
    true[:, 2, 3] = np.arange(31) / 10  # a metre a second straight ahead, then two
    true[20:, 2, 3] += np.arange(11) / 10
    turned = Rotation.from_euler("y", 30.0, degrees=True).as_matrix()
    found = true.copy()
    found[:, :3] = turned @ true[:, :3]
    paths = (Trajectory(np.arange(31) / 10, poses) for poses in (found, true))
    assert motion_deg(*paths) == pytest.approx(0.0, abs=1e-6)
    found[16:, :3, :3] = found[16:, :3, :3] @ turned  # the camera alone, by as much
    paths = (Trajectory(np.arange(31) / 10, poses) for poses in (found, true))
    # seconds that begin at frames 0 to 20, by the axes in their middles: 11 before the turn, 10 after it
    length = np.concatenate([np.ones(11), 1.0 + np.arange(1, 11) / 10])
    assert motion_deg(*paths) == pytest.approx(30.0 * length[11:].sum() / length.sum())


def test_biases_are_compared_in_the_middle_of_the_walk(tmp_path):
    rows = np.zeros((21, 7))
    rows[:, 0], rows[10, 1:] = np.arange(21) / 10, [0.01, 0.02, 0.03, 0.1, 0.2, 0.3]
    np.savetxt(tmp_path / "imu_biases.csv", rows, delimiter=",", header="t_s,...")
    t = np.arange(20) / 10
    solution = make_solution(t, np.tile(np.eye(4), (20, 1, 1)))
    imu = {
        "gyro_rad_s": [0.012, 0.02, 0.03],
        "gyro_sigma_rad_s": [0.001, 0.001, 0.001],
        "accelerometer_m_s2": [0.1, 0.2, 0.0],
        "accelerometer_sigma_m_s2": [0.1, 0.1, 0.1],
    }
    solution = replace(solution, sensors=replace(solution.sensors, imu=imu))
    found = bias_ratios(solution, tmp_path / "imu_biases.csv")
    np.testing.assert_allclose(found["gyro"], [[2.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(found["accelerometer"], [[0.0, 0.0, -3.0]], atol=1e-9)
    assert figures(np.array([[0.0, 3.0], [4.0, 1.0]])) == {
        "nees": 6.5,
        "within_3_sigma_percent": 75.0,
        "largest_ratio": 4.0,
    }


def test_what_chance_gives_narrows_with_the_samples():
    assert by_chance(10) == pytest.approx((3.247 / 10, 20.483 / 10), abs=1e-3)  # tables of chi squared
    low, high = by_chance(60)
    assert 0.67 < low < 0.68 and 1.38 < high < 1.39
