"""A path by IMU and fixes, and where that of a video strays from the fixes."""

from dataclasses import replace

import numpy as np
import pytest
from inertial import MOUNT, exact_log, path_of, swinging_motion
from scipy.spatial.transform import Rotation
from synthetic_fixes import fixes_of_size

from vgps.config import Config
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.factors import imu_graph
from vgps.smoothing.alignment.inertial_path import contradicted_intervals, inertial_path
from vgps.solution import Trajectory

ANTENNA = np.array([0.3, -0.8, 0.2])
MOTION = swinging_motion()
PATH = path_of(MOTION)


def fixes(late_s=0.0):
    """Fixes of a centimetre on the antenna, a second apart, with stamps that are too late."""
    t_s = np.arange(0.03, 10.0, 1.0)
    poses, size = MOTION.poses(t_s), np.full(len(t_s), 0.02)
    return fixes_of_size(t_s + late_s, poses[:, :3, :3] @ ANTENNA + poses[:, :3, 3], size, 2.0 * size)


def lost():
    """The path turned and elsewhere, with steps that get shorter by a fifth from frame to frame."""
    other = Rotation.from_euler("xyz", [40.0, 10.0, -120.0], degrees=True).as_matrix()
    poses = PATH.world_T_camera.copy()
    steps = np.diff(poses[:, :3, 3], axis=0) * 0.8 ** np.arange(len(poses) - 1)[:, None]
    poses[:, :3, 3] = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
    poses[:, :3, :3] = other @ poses[:, :3, :3]
    poses[:, :3, 3] = poses[:, :3, 3] @ other.T
    return Trajectory(PATH.t_s, poses)


def imu(until_s=10.0, **errors):
    return imu_at_camera(exact_log(MOTION, duration_s=until_s - 0.5, **errors), MOUNT, None, Config().imu)


def away(found):
    return np.linalg.norm(found.world_T_camera[:, :3, 3] - PATH.world_T_camera[:, :3, 3], axis=1)


def test_a_path_strays_where_it_moves_otherwise_than_the_fixes():
    assert not contradicted_intervals(PATH, fixes(), ANTENNA).any()
    assert contradicted_intervals(lost(), fixes(), ANTENNA).all()
    poses = PATH.world_T_camera.copy()
    poses[35:, :3, 3] += [0.0, 9.0, 0.0]
    jumping = Trajectory(PATH.t_s, poses)
    assert np.flatnonzero(contradicted_intervals(jumping, fixes(), ANTENNA)).tolist() == [3]
    coarse = replace(fixes(), r_m=np.full(10, 10.0))
    assert not contradicted_intervals(jumping, coarse, ANTENNA).any()
    unused = replace(fixes(), used=np.arange(10) < 3)
    assert len(contradicted_intervals(jumping, unused, ANTENNA)) == 2


def test_imu_and_fixes_give_the_path_of_a_video_without_scale():
    gyro, force = np.array([0.2, -0.3, 0.1]), np.array([0.1, 0.05, -0.1])
    found = inertial_path(
        lost(), imu(11.0, gyro_bias=gyro, accelerometer_bias=force), fixes(), ANTENNA, Config()
    )
    assert away(found).max() < 0.2
    off = found.world_T_camera[:, :3, :3] @ PATH.world_T_camera[:, :3, :3].transpose(0, 2, 1)
    assert np.degrees(Rotation.from_matrix(off).magnitude()).max() < 3.0


def test_frames_that_the_imu_does_not_cover_continue_the_path():
    found = inertial_path(lost(), imu(9.74), fixes(), ANTENNA, Config())
    assert len(found) == len(PATH) and away(found).max() < 0.2  # the last three at constant velocity
    turns = (
        poses[:-1, :3, :3].transpose(0, 2, 1) @ poses[1:, :3, :3]
        for poses in (found.world_T_camera, PATH.world_T_camera)
    )
    np.testing.assert_allclose(*turns, atol=2e-3)


@pytest.mark.slow
def test_fixes_with_another_clock_than_the_imu_give_no_path_as_few_knots_show(monkeypatch):
    knots = []

    def counted(imu, states, *rest):
        knots.append(len(states))
        return imu_graph(imu, states, *rest)

    monkeypatch.setattr("vgps.smoothing.alignment.inertial_path.imu_graph", counted)
    assert inertial_path(lost(), imu(11.0), fixes(3.0), ANTENNA, Config()) is None
    assert len(knots) == 1 and knots[0] <= 3 * len(fixes())


@pytest.mark.parametrize("first", [2, 8])
def test_without_samples_or_enough_fixes_there_is_no_path(first):
    few = replace(fixes(), used=np.arange(10) >= first)
    whole = imu(11.0)
    gap = replace(whole, broken=np.arange(len(whole.broken)) == 1000) if first == 2 else whole
    assert inertial_path(lost(), gap, few, ANTENNA, Config()) is None
