"""A wrong focal length shows in the ratio of the gyro's rotations to the video's."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solutions import make_solution

from vgps.model import Camera, CameraGuess, GyroLog, Recording, Rig
from vgps.pipeline.gyro_agreement import rotation_ratio, with_gyro_focal, with_gyro_note

T_S = np.arange(0.0, 12.0, 1 / 15)
CAMERA = Camera(
    model="opencv", width=640, height=480, fx=500, fy=500, cx=320, cy=240, distortion=(0.0, 0.0, 0.0, 0.0)
)
MOUNT = Rotation.from_euler("xyz", [80, 10, -20], degrees=True).as_matrix()


def angle(t_s, scale):
    """Looking about: small rotations about the image's axes."""
    return scale * np.stack([0.05 * np.sin(t_s), 0.08 * np.cos(0.7 * t_s), 0.0 * t_s], axis=1)


def run(scale):
    """Poses of a video that turns by that share of what the gyro measures."""
    poses = np.tile(np.eye(4), (len(T_S), 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(angle(T_S, scale)).as_matrix()
    poses[:, 0, 3] = T_S
    return replace(make_solution(T_S, poses), camera=CAMERA)


def recording(bias=0.01):
    t_s = np.arange(-0.1, 12.1, 0.005)
    step = 1e-3
    ends = [Rotation.from_rotvec(angle(t_s + sign * step, 1.0)) for sign in (-1, 1)]
    rates = (ends[0].inv() * ends[1]).as_rotvec() / (2 * step) @ MOUNT.T + bias
    guess = CameraGuess(
        camera=CAMERA, focal_sigma=0.1, centre_sigma_px=5, distortion_sigma=(0.1, 0.1), source="a lens"
    )
    return Recording(
        path=None,
        video=None,
        camera=CAMERA,
        rig=Rig(gyro_R_camera=MOUNT),
        gyro=GyroLog(t_s, rates, None),
        guesses=(guess,),
    )


@pytest.mark.parametrize("scale", [0.75, 1.0, 1.1])
def test_the_ratio_is_that_of_the_focal_lengths(scale):
    ratio = rotation_ratio(run(scale), recording())
    assert ratio.value == pytest.approx(1 / scale, rel=0.01)
    assert ratio.sigma < 0.02


def test_nothing_is_said_of_a_camera_that_hardly_turns_or_of_another_motion():
    assert rotation_ratio(run(0.02), recording()) is None
    backwards = recording()
    shuffled = replace(backwards.gyro, rate_rad_s=backwards.gyro.rate_rad_s[::-1].copy())
    assert rotation_ratio(run(1.0), replace(backwards, gyro=shuffled)) is None
    assert rotation_ratio(run(1.0), replace(backwards, gyro=None)) is None


def test_a_wrong_calibration_is_told_and_a_right_one_is_not():
    assert with_gyro_note(run(1.0), recording()).warnings == ()
    (note,) = with_gyro_note(run(0.75), recording()).warnings
    assert note.startswith("the gyro turns 1.33 times as far as the video")
    assert "the focal length of 500 px is too long, 375 px would agree: check camera.yaml" in note


def test_an_unknown_camera_takes_the_gyros_focal_length():
    known = with_gyro_focal(recording(), run(0.95))
    assert known.camera.fx == pytest.approx(475, rel=0.01)
    (guess,) = known.guesses
    assert guess.camera.fx == known.camera.fx and guess.focal_sigma < 0.02
    assert guess.source == "a lens; the focal length by the gyro"
    still = with_gyro_focal(recording(), run(0.02))
    assert still.camera == CAMERA and still.guesses == recording().guesses
