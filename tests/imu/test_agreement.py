import re
from dataclasses import replace

import numpy as np
import pytest
from inertial import MOUNT, exact_log, path_of, swinging_motion
from scipy.spatial.transform import Rotation

from vgps.config import ImuConfig
from vgps.imu.agreement import Agreement, agreement, path_rotations
from vgps.imu.camera_imu import imu_at_camera
from vgps.solution import Trajectory

MOTION = swinging_motion()


def pieces(noise_deg=0.02):
    """The path in two pieces, each in a frame of its own, with the noise of tracking."""
    path, rng = path_of(MOTION), np.random.default_rng(1)
    poses = path.world_T_camera.copy()
    noise = Rotation.from_rotvec(np.radians(noise_deg) * rng.standard_normal((len(poses), 3)))
    poses[:, :3, :3] = poses[:, :3, :3] @ noise.as_matrix()
    poses[50:] = np.linalg.inv(poses[50]) @ poses[50:]
    poses[70] = np.nan
    return [Trajectory(path.t_s[:50], poses[:50]), Trajectory(path.t_s[50:], poses[50:])]


def found(turn_deg=(0.0, 0.0, 0.0), late_s=0.0, unit=1.0, motion=MOTION, noise_deg=0.02):
    log = exact_log(motion, gyro_bias=0.03)
    log = replace(log, t_s=log.t_s + late_s, rate_rad_s=unit * log.rate_rad_s)
    turn = Rotation.from_euler("xyz", turn_deg, degrees=True).as_matrix()
    mount = replace(MOUNT, imu_R_camera=MOUNT.imu_R_camera @ turn)
    return agreement(path_rotations(pieces(noise_deg)), imu_at_camera(log, mount, None, ImuConfig()))


@pytest.mark.slow
@pytest.mark.parametrize("given", [{}, {"turn_deg": (0.5, -0.5, 0.5)}, {"late_s": 0.008}])
def test_an_imu_that_turns_as_the_video_does_is_used(given):
    assert found(**given).contradiction is None


@pytest.mark.slow
def test_a_clock_that_is_a_little_off_is_found():
    late = found(late_s=0.015)
    assert 0.0 < late.time_offset_sigma_s < 3e-3
    assert late.time_offset_s == pytest.approx(-0.015, abs=2.0 * late.time_offset_sigma_s)
    assert found().time_offset_s == 0.0 and not late.misled


@pytest.mark.slow
def test_a_clock_that_misled_the_tracking_is_no_contradiction():
    late = found(late_s=0.06)
    assert late.contradiction is None and late.misled
    assert late.time_offset_s == pytest.approx(-0.06, abs=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.3, -1.7])
def test_a_clock_that_is_far_off_is_looked_for(late_s):
    late = found(late_s=late_s)
    assert late.contradiction is None and late.misled
    assert late.time_offset_s == pytest.approx(-late_s, abs=4.0 * late.time_offset_sigma_s)


@pytest.mark.slow
def test_a_clock_that_may_be_right_or_is_off_by_next_to_nothing_stays():
    by_chance = found(late_s=0.004)
    assert by_chance.time_offset_s == 0.0 and 3.0 * by_chance.time_offset_sigma_s > 0.004
    hardly = found(late_s=0.0005, noise_deg=0.001)
    assert hardly.time_offset_s == 0.0 and 3.0 * hardly.time_offset_sigma_s < 0.0005


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"turn_deg": (0.0, 0.0, 90.0)}, r"correlate to -?0\.\d\d only"),
        (
            {"turn_deg": (6.0, 0.0, 0.0)},
            r"mounted otherwise .* by (about )?-[56]\.\d, -?0\.\d, -?0\.\d degrees",
        ),
        ({"unit": 57.3}, r"turns 57\.\d times as far as the video \(rates in rad/s"),
    ],
)
def test_what_contradicts_is_named(given, message):
    assert re.search(message, found(**given).contradiction or "")


def test_a_camera_that_does_not_turn_shows_nothing():
    path = path_of(MOTION)
    poses = path.world_T_camera.copy()
    poses[:, :3, :3] = poses[0, :3, :3]
    imu = imu_at_camera(exact_log(MOTION), MOUNT, None, ImuConfig())
    assert agreement(path_rotations([Trajectory(path.t_s, poses)]), imu) == Agreement(None)
