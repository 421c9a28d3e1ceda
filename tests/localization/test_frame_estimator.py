import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.localization.frame_estimator import FrameEstimator, motion_between
from vgps.localization.pose import NO_MATCHES, PoseEstimate
from vgps.localization.prediction import MotionState

BIAS = np.array([0.01, 0.02, 0.03])


def pose(position, yaw=0.0):
    out = np.eye(4)
    out[:3, :3] = Rotation.from_euler("y", yaw).as_matrix()
    out[:3, 3] = position
    return out


def test_velocities_by_hand():
    # 0.2 m forward and 0.05 rad about y in a tenth of a second
    last = MotionState(t_s=2.0, world_T_camera=pose((1, 2, 3), yaw=0.3))
    motion = motion_between(last, 2.1, pose((1, 2, 3.2), yaw=0.35), BIAS, 0.5)
    np.testing.assert_allclose(motion.world_v_camera, [0, 0, 2.0], atol=1e-9)
    np.testing.assert_allclose(motion.camera_w_rad_s, [0, 0.5, 0], atol=1e-9)
    np.testing.assert_array_equal(motion.gyro_bias_rad_s, BIAS)
    assert motion.t_s == 2.1


def test_the_velocity_of_a_fast_car_is_learned():
    last = MotionState(t_s=0.0, world_T_camera=np.eye(4))
    motion = motion_between(last, 0.1, pose((0, 0, 6.0)), BIAS, 0.5)
    np.testing.assert_allclose(motion.world_v_camera, [0, 0, 60.0])


@pytest.mark.parametrize("last", [None, MotionState(t_s=1.0, world_T_camera=np.eye(4))])
def test_velocities_are_unknown_at_a_start_and_across_a_long_interval(last):
    motion = motion_between(last, 1.6, pose((0, 0, 0.1)), BIAS, 0.5)
    assert motion.world_v_camera is None
    assert not motion.camera_w_rad_s.any()


def test_a_pose_is_passed_through_and_becomes_the_state():
    estimator = FrameEstimator(0.5)
    assert estimator.motion is None
    estimate = PoseEstimate(pose((1, 0, 0)), np.eye(6), np.zeros(0, bool))
    for t_s in (0.0, 0.1):
        final = estimator.add(t_s, estimate, NO_MATCHES, restart=False)
        np.testing.assert_array_equal(final.world_T_camera, estimate.world_T_camera)
        np.testing.assert_array_equal(final.covariance, estimate.covariance)
    np.testing.assert_array_equal(estimator.motion.world_v_camera, np.zeros(3))
    assert estimator.revised() == {}
