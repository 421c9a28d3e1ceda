import numpy as np
import pytest
from angles import apart_deg
from inertial import MOUNT, exact_log, path_of, swinging_motion
from scipy.spatial.transform import Rotation

from vgps.config import ImuConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.rotation import RotationPredictor, rotation_sigma_rad
from vgps.model import ImuMount
from vgps.solution import Trajectory

MOTION = swinging_motion()
PATH = path_of(MOTION)


def predictor(mount=MOUNT, **errors):
    return RotationPredictor(
        imu_at_camera(exact_log(MOTION, **errors), mount, None, ImuConfig()), ImuConfig()
    )


def until(frame):
    return Trajectory(PATH.t_s[:frame], PATH.world_T_camera[:frame].copy())


def test_the_path_shows_the_bias():
    gyro = predictor(gyro_bias=np.array([0.05, -0.04, 0.03]))
    true = PATH.world_T_camera[59, :3, :3].T @ PATH.world_T_camera[60, :3, :3]
    assert apart_deg(gyro.between(5.9, 6.0), true) > 0.3
    found = gyro.predict(until(60), 6.0)
    assert apart_deg(found.rotation, true) < 0.01
    assert np.degrees(found.sigma_rad) == pytest.approx(0.033, abs=0.01)


def test_the_first_frames_of_a_map_show_no_bias():
    rough = until(5)
    rough.world_T_camera[1:, :3, :3] = (
        rough.world_T_camera[1:, :3, :3] @ Rotation.from_euler("y", 1.0, degrees=True).as_matrix()
    )
    true = PATH.world_T_camera[4, :3, :3].T @ PATH.world_T_camera[5, :3, :3]
    found = predictor().predict(rough, 0.5)
    assert apart_deg(found.rotation, true) < 0.01
    assert np.degrees(found.sigma_rad) == pytest.approx(
        np.degrees(ImuConfig().gyro_bias_sigma * 0.1), rel=0.1
    )


def test_a_lost_camera_keeps_its_orientation():
    true = PATH.world_T_camera[59, :3, :3].T @ PATH.world_T_camera[80, :3, :3]
    found = predictor().predict(until(60), 8.0)
    assert apart_deg(found.rotation, true) < 0.1
    assert found.sigma_rad > rotation_sigma_rad(predictor()._imu, 2.1)


def test_no_prediction_without_samples_or_with_another_mounting():
    assert predictor().predict(until(60), 20.0) is None
    turned = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    other = ImuMount(imu_R_camera=MOUNT.imu_R_camera @ turned, imu_p_camera=MOUNT.imu_p_camera)
    assert predictor().predict(until(90), 9.0) is not None
    assert predictor(other).predict(until(90), 9.0) is None
