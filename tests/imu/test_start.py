import numpy as np
from inertial import MOUNT, exact_log, path_of, swinging_motion
from scipy.spatial.transform import Rotation

from vgps.config import ImuConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.start import start_states
from vgps.solution import Trajectory


def test_velocities_and_the_bias_of_the_gyro_are_found_on_a_path_that_is_a_little_off():
    motion, rng = swinging_motion(), np.random.default_rng(2)
    gyro = np.array([0.02, -0.03, 0.01])
    imu = imu_at_camera(exact_log(motion, gyro_bias=gyro), MOUNT, None, ImuConfig())
    path = path_of(motion)
    poses = path.world_T_camera.copy()
    tilt = Rotation.from_rotvec(np.radians([1.0, -0.7, 0.0])).as_matrix()
    poses[:, :3, :3] = tilt @ poses[:, :3, :3]
    poses[:, :3, 3] += rng.normal(0.0, 0.02, (len(poses), 3))
    unseen = np.zeros(len(poses), dtype=bool)
    states = start_states(Trajectory(path.t_s, poses), unseen, imu, ImuConfig())
    np.testing.assert_allclose(states.velocity, motion.spline(path.t_s[states.frame], 1)[:, :3], atol=0.15)
    np.testing.assert_allclose(states.bias[5, 3:], gyro @ MOUNT.imu_R_camera, atol=2e-3)
