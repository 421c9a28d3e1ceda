import numpy as np
from inertial import MOUNT, exact_log, path_of, swinging_motion

from vgps.config import ImuConfig
from vgps.imu.camera_imu import imu_at_camera
from vgps.imu.states import bias_key, first_states, velocity_key

MOTION = swinging_motion()
IMU = imu_at_camera(exact_log(MOTION), MOUNT, None, ImuConfig())
PATH = path_of(MOTION)
SEEN = np.zeros(len(PATH.t_s), dtype=bool)


def test_a_knot_every_second_and_one_at_the_end():
    states = first_states(PATH, SEEN, IMU, ImuConfig())
    np.testing.assert_array_equal(states.frame, np.arange(0, 101, 10))
    assert states.linked.all()
    np.testing.assert_allclose(states.velocity[5], MOTION.spline(5.0, 1)[:3], atol=0.02)


def test_loose_frames_are_knots():
    loose = SEEN.copy()
    loose[43:45] = True
    states = first_states(PATH, loose, IMU, ImuConfig())
    np.testing.assert_array_equal(states.frame[4:8], [40, 43, 44, 50])


def test_knots_without_an_imu_are_left_out():
    log = exact_log(MOTION, duration_s=6.4)
    imu = imu_at_camera(log, MOUNT, None, ImuConfig())
    states = first_states(PATH, SEEN, imu, ImuConfig())
    np.testing.assert_array_equal(states.frame, [0, 10, 20, 30, 40, 50, 60])
    late = imu_at_camera(exact_log(MOTION, duration_s=0.1), MOUNT, None, ImuConfig())
    assert first_states(PATH, SEEN, late, ImuConfig()) is None


def test_states_move_to_the_values_of_a_graph():
    states = first_states(PATH, SEEN, IMU, ImuConfig())
    vectors = {velocity_key(k): np.full(3, k) for k in range(len(states))}
    vectors |= {bias_key(k): np.full(6, -k) for k in range(len(states))}
    moved = states.moved(vectors)
    np.testing.assert_array_equal(moved.velocity[:, 0], range(11))
    np.testing.assert_array_equal(moved.bias[:, 5], -np.arange(11))
