import numpy as np
import pytest
from angles import apart_deg
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from synthetic_rotations import MOUNT, camera_rotations, gyro_log, rich

from vgps.config import GyroCalibrationConfig
from vgps.geometry.angular_rates import GyroIntegral
from vgps.gyro_calibration.coarse import align_rates, guess_offset

CONFIG = GyroCalibrationConfig(search_s=0.5)


def test_an_alignment_by_hand() -> None:
    """A gyro whose x is the camera's y, y its -x; each axis turns once, a constant rate is no matter."""
    camera = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 2.0, 0], [0, -2.0, 0], [0, 0, 3.0], [0, 0, -3.0]])
    gyro = np.stack([camera[:, 1], -camera[:, 0], camera[:, 2]], axis=1) + np.array([5.0, -6.0, 7.0])
    found = align_rates(gyro, camera)
    np.testing.assert_allclose(found.gyro_R_camera, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert found.agreement == pytest.approx(1.0)
    np.testing.assert_allclose(found.scatter, [18 / 6, 8 / 6, 2 / 6])


@pytest.mark.slow
@given(st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_any_rotation_is_found_again_and_scipy_agrees(quaternion: tuple[float, ...]) -> None:
    R = Rotation.from_quat(quaternion)
    camera = rich(np.linspace(0, 10, 60))
    camera = camera - camera.mean(axis=0)
    found = align_rates(R.apply(camera), camera).gyro_R_camera
    by_scipy = Rotation.align_vectors(R.apply(camera), camera)[0].as_matrix()
    np.testing.assert_allclose(found, by_scipy, atol=1e-7)
    assert apart_deg(found, R.as_matrix()) < 1e-5


def test_a_mirrored_gyro_is_not_taken_for_a_rotation() -> None:
    camera = rich(np.linspace(0, 10, 60))
    found = align_rates(camera * [1, 1, -1], camera)
    assert np.linalg.det(found.gyro_R_camera) == pytest.approx(1.0)
    assert found.agreement < 0.9


def test_weights_silence_what_is_wrong() -> None:
    camera = rich(np.linspace(0, 10, 60))
    gyro = camera @ MOUNT.gyro_R_camera.T
    weight = np.ones(60)
    weight[:20] = 0.0
    gyro[:20] = 100.0
    assert apart_deg(align_rates(gyro, camera, weight).gyro_R_camera, MOUNT.gyro_R_camera) < 1e-5
    assert apart_deg(align_rates(gyro, camera).gyro_R_camera, MOUNT.gyro_R_camera) > 1.0


def test_the_offset_is_found_to_a_fraction_of_a_frame() -> None:
    turns = camera_rotations(rich, 10.0)
    rates = Rotation.from_matrix(turns.start_R_end).as_rotvec() / 0.05
    guess = guess_offset(turns, rates, GyroIntegral(gyro_log(rich, 10.0)), CONFIG)
    assert guess is not None
    assert guess.time_offset_s == pytest.approx(MOUNT.time_offset_s, abs=0.05 / 8)
    assert guess.alignment.agreement > 0.999 > guess.runner_up
    assert apart_deg(guess.alignment.gyro_R_camera, MOUNT.gyro_R_camera) < 1.0


def test_a_gyro_of_another_time_gives_no_offset() -> None:
    turns = camera_rotations(rich, 10.0)
    log = gyro_log(rich, 10.0)
    late = type(log)(log.t_s + 100.0, log.rate_rad_s, log.source)
    assert guess_offset(turns, np.ones((len(turns), 3)), GyroIntegral(late), CONFIG) is None
