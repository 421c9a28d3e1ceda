"""The vertical of a path by an exact IMU."""

import numpy as np
import pytest
from inertial import GRAVITY_M_S2, MOUNT, exact_log, path_of, swinging_motion
from scipy.spatial.transform import Rotation
from synthetic_fixes import fixes_of_size

import vgps
from vgps.gps.fixes import CLASSES
from vgps.imu.camera_imu import imu_at_camera
from vgps.model import FixClass
from vgps.online.fusion.fusion_equations import BIAS
from vgps.online.fusion.gravity import Gravity
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.path_fusion import fuse
from vgps.online.fusion.video_path import VideoPath

CONFIG, SCALE = vgps.Config(), 3.0
TURN = Rotation.from_euler("xyz", [8.0, -5.0, 30.0], degrees=True).as_matrix()


def gravity(**errors):
    return Gravity(imu_at_camera(exact_log(swinging_motion(), **errors), MOUNT, None, CONFIG.imu), CONFIG.imu)


def seen(turn=TURN, scale=SCALE):
    """The path that the video gives: map_T_camera with the world turned and smaller, and the true path."""
    true = path_of(swinging_motion())
    poses = true.world_T_camera.copy()
    poses[:, :3, :3] = turn @ poses[:, :3, :3]
    poses[:, :3, 3] = poses[:, :3, 3] @ turn.T / scale
    return VideoPath(t_s=true.t_s, poses=poses, moving=np.ones(len(poses), dtype=bool)), true


def test_up_is_up_whatever_the_camera_does():
    path, _ = seen()
    t_s = np.linspace(1.0, 10.0, 19)
    up = gravity().up(path, t_s, np.full(19, SCALE))
    off = np.arccos(np.clip(up.direction @ TURN[:, 2], -1.0, 1.0))
    assert np.degrees(off.max()) < 0.5 and (off < 3.0 * up.sigma_rad).all()
    # with the acceleration of a wrong scale it is not
    wrong = gravity().up(path, t_s, np.full(19, 2.0 * SCALE)).direction
    assert np.degrees(np.arccos(wrong @ TURN[:, 2]).max()) > 2.0


def test_where_samples_or_frames_lack_nothing_is_known():
    path, _ = seen()
    up = gravity().up(path, np.array([0.0, 0.3, 5.0]), np.full(3, SCALE))
    assert np.isinf(up.sigma_rad[:2]).all() and up.sigma_rad[2] < np.radians(2.0)
    later = VideoPath(t_s=path.t_s + 60.0, poses=path.poses, moving=path.moving)
    assert np.isinf(gravity().up(later, np.array([65.0]), np.ones(1)).sigma_rad).all()


def fused(given):
    """The fit of a tilted path to fixes whose height drifts, and its tilt in degrees."""
    true = path_of(swinging_motion())
    roll = Rotation.from_euler("x", 4.0, degrees=True).as_matrix()
    path, _ = seen(roll, 1.0)
    arm, rows = LeverArm.within(np.zeros(3)), np.arange(0, len(true.t_s), 10)
    drift = np.outer(0.3 * true.t_s[rows], [0.0, 0.0, 1.0])
    fixes = fixes_of_size(
        true.t_s[rows],
        true.world_T_camera[rows, :3, 3] + drift,
        np.full(len(rows), 2.4),
        np.full(len(rows), 6.5),
    )
    fixes.fix_class[:], fixes.correlation_s[:] = CLASSES.index(FixClass.RTK_FLOAT), 60.0
    fit = None
    for last in (50, 75, len(path.t_s)):
        part = VideoPath(t_s=path.t_s[:last], poses=path.poses[:last], moving=path.moving[:last])
        fit = fuse(part, fixes, arm, CONFIG, fit, given)
    tilt = fit.state.world_R_map[-1] @ roll
    return fit, np.degrees(np.arccos(tilt[2, 2]))


def test_an_imu_levels_a_path_that_its_fixes_do_not():
    (_, without), (fit, with_imu) = fused(None), fused(gravity())
    assert with_imu < 1.0 and with_imu < 0.5 * without
    sigma = np.degrees(np.sqrt(np.diag(fit.covariance)[4:6]))
    assert with_imu < 3.0 * np.linalg.norm(sigma)


def test_a_bias_of_the_accelerometer_is_stated_where_nothing_shows_it():
    bias = MOUNT.imu_R_camera @ [0.15, 0.0, 0.0]  # to the camera's right
    fit, tilt = fused(gravity(accelerometer_bias=bias))
    both = np.hypot(tilt, np.degrees(np.linalg.norm(fit.state.values[-1, BIAS])))
    assert both > 0.5 * np.degrees(0.15 / GRAVITY_M_S2)  # it is in one or the other
    sigma = np.degrees(np.sqrt(np.diag(fit.covariance)[4:6]))
    assert tilt < 3.0 * np.linalg.norm(sigma) and sigma.max() > 0.3


def test_the_sigma_of_the_bias_is_the_configured_one():
    assert gravity().bias_rad == pytest.approx(CONFIG.imu.accelerometer_bias_sigma / GRAVITY_M_S2)
