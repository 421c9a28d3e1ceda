"""Which way an accelerometer's axes point follows from gravity and from what the path does."""

import re
from dataclasses import replace

import numpy as np
import pytest
from inertial import MOUNT, exact_log, path_of, swinging_motion
from scipy.spatial.transform import Rotation

from vgps.config import ImuConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.force_agreement import wrong_forces
from vgps.solution import Trajectory

MOTION = swinging_motion()
MOUNTED = replace(MOUNT, imu_p_camera=np.zeros(3))  # of the columns as they are
PATH = path_of(MOTION)
AS_THEY_ARE = np.eye(3)


def found(columns=AS_THEY_ARE, path=PATH, until_s=np.inf):
    """What is found if the log's columns hold ``columns @ force``."""
    log = exact_log(MOTION, MOUNTED, accelerometer_bias=np.array([0.2, -0.3, 0.1]))
    kept = log.t_s < until_s
    log = replace(
        log,
        t_s=log.t_s[kept],
        rate_rad_s=log.rate_rad_s[kept],
        force_m_s2=log.force_m_s2[kept] @ np.asarray(columns).T,
        saturated=log.saturated[kept],
    )
    return wrong_forces(path, imu_at_camera(log, MOUNTED, None, ImuConfig()), MOUNTED)


def bent(tilt_deg=0.0, scale=1.0, noise_m=0.0):
    """The path as stage C may leave it."""
    poses, rng = PATH.world_T_camera.copy(), np.random.default_rng(0)
    tilt = Rotation.from_euler("y", tilt_deg, degrees=True).as_matrix()
    poses[:, :3, :3] = tilt @ poses[:, :3, :3]
    poses[:, :3, 3] = scale * poses[:, :3, 3] @ tilt.T + noise_m * rng.standard_normal((len(poses), 3))
    return Trajectory(PATH.t_s, poses)


@pytest.mark.parametrize(
    "path", [PATH, bent(tilt_deg=20.0), bent(scale=1.4), bent(scale=0.6, tilt_deg=-10.0, noise_m=0.05)]
)
def test_right_axes_are_right_whatever_stage_c_left(path):
    assert found(path=path) is None


@pytest.mark.parametrize("path", [PATH, bent(tilt_deg=10.0, scale=1.2, noise_m=0.02)])
@pytest.mark.parametrize(
    ("columns", "right"),
    [
        (-np.eye(3), "-ax, -ay, -az"),
        (np.diag([1, 1, -1]), "ax, ay, -az"),
        (np.eye(3)[[1, 0, 2]], "ay, ax, az"),
        ([[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "-ay, ax, az"),
        (np.eye(3)[[1, 2, 0]], "az, ax, ay"),
    ],
)
def test_wrong_forces_are_named(columns, right, path):
    assert (found(columns, path) or "").startswith(f"{right} in the place of ax, ay, az")


def test_a_lever_arm_of_metres_that_is_none_is_named():
    near = replace(MOUNTED, imu_p_camera=np.array([0.05, -0.08, 0.02]))
    far = replace(MOUNTED, imu_p_camera=np.array([5.0, -8.0, 2.0]))  # centimetres
    log = exact_log(MOTION, near)
    assert wrong_forces(PATH, imu_at_camera(log, near, None, ImuConfig()), near) is None
    said = wrong_forces(PATH, imu_at_camera(log, far, None, ImuConfig()), far)
    assert said is not None
    at_m = np.array(re.findall(r"-?\d+\.\d", said), dtype=float)
    np.testing.assert_allclose(at_m, near.imu_p_camera, atol=0.3)


def test_a_second_of_samples_shows_nothing():
    assert found(-np.eye(3), until_s=1.5) is None
    assert found(-np.eye(3), until_s=-0.1) is None
