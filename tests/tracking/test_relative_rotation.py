import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vgps.camera import distort, undistort
from vgps.config import RotationConfig, TrackingConfig
from vgps.model import Camera, Frame
from vgps.tracking.relative_rotation import RelativeRotations, frame_rotations, relative_rotation

CAMERA = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.0, cy=240.0)
SIDEWAYS, AHEAD, NONE = (0.4, 0.05, 0.0), (0.02, -0.03, 0.6), (0.0, 0.0, 0.0)


def two_views(turn, move, noise_px=0.0, seed=0, count=150):
    """Pixels of points 4 to 40 m away before and after the camera turned (rotation vector) and moved."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform((20, 20), (620, 460), (count, 2))
    depth = rng.uniform(4.0, 40.0, count)
    points = np.column_stack([(uv - CAMERA.K[:2, 2]) / (500.0, 510.0), np.ones(count)]) * depth[:, None]
    # first_R_second takes coordinates of the second camera to the first's
    second = (points - move) @ Rotation.from_rotvec(turn).as_matrix()
    moved = second[:, :2] / second[:, 2:] * (500.0, 510.0) + CAMERA.K[:2, 2]
    return uv, moved + noise_px * rng.normal(size=moved.shape)


def error_rad(found, turn):
    return Rotation.from_matrix(Rotation.from_rotvec(turn).as_matrix().T @ found).as_rotvec()


def test_the_direction_of_a_pan_by_hand():
    """A pan to the right, about y (down): what was in the middle moves to the left by f tan(angle)."""
    angle = 0.1
    uv, moved = two_views([0, angle, 0], NONE)
    middle = two_views([0, angle, 0], NONE, count=1)
    assert middle[1][0, 0] < middle[0][0, 0]
    first_R_second, _ = relative_rotation(CAMERA.K, uv, moved, RotationConfig())
    # the second camera's forward axis as the first sees it points to the right
    np.testing.assert_allclose(first_R_second[:, 2], [np.sin(angle), 0, np.cos(angle)], atol=1e-6)


@pytest.mark.parametrize("move", [SIDEWAYS, AHEAD, NONE], ids=["sideways", "ahead", "none"])
@settings(max_examples=15, deadline=None)
@given(turn=st.tuples(*[st.floats(-0.12, 0.12)] * 3))
def test_a_turn_is_found_exactly_however_the_camera_moves(move, turn):
    first_R_second, _ = relative_rotation(CAMERA.K, *two_views(turn, move), RotationConfig())
    assert np.abs(error_rad(first_R_second, turn)).max() < 1e-5


@pytest.mark.parametrize("move", [SIDEWAYS, AHEAD, NONE], ids=["sideways", "ahead", "none"])
def test_the_covariance_is_that_of_many_tries(move):
    """Squared errors in units of the covariance have a mean of 3."""
    turn, squared = [0.02, -0.03, 0.01], []
    for seed in range(40):
        found, covariance = relative_rotation(CAMERA.K, *two_views(turn, move, 0.3, seed), RotationConfig())
        error = error_rad(found, turn)
        squared.append(error @ np.linalg.solve(covariance, error))
    assert 1.0 < np.mean(squared) < 6.0


def test_a_third_of_wrong_matches_does_no_harm():
    turn = [0.02, -0.03, 0.01]
    uv, moved = two_views(turn, SIDEWAYS, 0.2, 3)
    moved[::3] += np.random.default_rng(4).uniform(-40, 40, moved[::3].shape)
    found, _ = relative_rotation(CAMERA.K, uv, moved, RotationConfig())
    assert np.degrees(np.abs(error_rad(found, turn)).max()) < 0.1


def test_features_that_were_lost_are_passed_over():
    uv, moved = two_views([0.02, 0, 0], SIDEWAYS)
    moved[::4] = np.nan
    found, _ = relative_rotation(CAMERA.K, uv, moved, RotationConfig())
    assert np.abs(error_rad(found, [0.02, 0, 0])).max() < 1e-5


def test_too_few_features_and_no_rigid_scene_give_nothing():
    uv, moved = two_views([0.02, 0, 0], SIDEWAYS)
    assert relative_rotation(CAMERA.K, uv[:20], moved[:20], RotationConfig()) is None
    assert relative_rotation(CAMERA.K, uv, np.full_like(moved, np.nan), RotationConfig()) is None
    anywhere = np.random.default_rng(99).uniform(0, 480, moved.shape)
    assert relative_rotation(CAMERA.K, uv, anywhere, RotationConfig()) is None


def texture(seed=5):
    """A picture with detail of every size, larger than a frame."""
    rng = np.random.default_rng(seed)
    layers = [
        cv2.GaussianBlur(rng.normal(size=(960, 1280)).astype(np.float32), (0, 0), s) * s for s in (2, 5, 12)
    ]
    return cv2.normalize(sum(layers), None, 0, 255, cv2.NORM_MINMAX)


def view(picture, world_R_camera, camera=CAMERA):
    """What a camera sees of a picture at infinity."""
    uv = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).reshape(-1, 2)
    uv = uv.astype(np.float64)
    rays = np.column_stack([(uv - camera.K[:2, 2]) / (camera.fx, camera.fy), np.ones(len(uv))])
    seen = rays @ world_R_camera.T
    at = (seen[:, :2] / seen[:, 2:] * 500.0 + (640, 480)).astype(np.float32)
    sampled = cv2.remap(picture, at.reshape(camera.height, camera.width, 2), None, cv2.INTER_CUBIC)
    return sampled.clip(0, 255).astype(np.uint8)


def frames_of(rotations, interval_s=0.05):
    picture = texture()
    images = [view(picture, R) for R in rotations]
    return [Frame(i, interval_s * i, image) for i, image in enumerate(images)]


@pytest.fixture(scope="module")
def panned():
    """Six frames that turn by some degrees each, by no rule."""
    turns = np.random.default_rng(2).uniform(-0.06, 0.06, (5, 3))
    rotations = [np.eye(3)]
    for turn in turns:
        rotations.append(rotations[-1] @ Rotation.from_rotvec(turn).as_matrix())
    return turns, frames_of(rotations)


def test_turns_from_pictures(panned):
    turns, frames = panned
    found = frame_rotations(
        iter(frames), CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig()
    )
    assert len(found) == 5 and found.missed == 0
    np.testing.assert_allclose(found.start_s, [0.0, 0.05, 0.1, 0.15, 0.2])
    np.testing.assert_allclose(found.end_s, [0.05, 0.1, 0.15, 0.2, 0.25])
    errors = [error_rad(R, turn) for R, turn in zip(found.start_R_end, turns, strict=True)]
    assert np.degrees(np.abs(errors).max()) < 0.02
    sigma = np.sqrt(np.array([np.diag(covariance) for covariance in found.covariance]))
    assert sigma.min() > 1e-6 and np.degrees(sigma.max()) < 0.05


def test_frames_too_near_each_other_are_passed_over(panned):
    turns, frames = panned
    found = frame_rotations(
        frames, CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig(), min_interval_s=0.09
    )
    np.testing.assert_allclose(found.start_s, [0.0, 0.1])
    np.testing.assert_allclose(found.end_s, [0.1, 0.2])
    both = (Rotation.from_rotvec(turns[0]) * Rotation.from_rotvec(turns[1])).as_rotvec()
    assert np.degrees(np.abs(error_rad(found.start_R_end[0], both)).max()) < 0.05


def test_a_turn_farther_than_a_matcher_looks():
    """A sixth of the picture's width from one frame to the next."""
    turn = [0.0, 0.2, 0.0]
    frames = frames_of([np.eye(3), Rotation.from_rotvec(turn).as_matrix()])
    found = frame_rotations(frames, CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig())
    assert len(found) == 1
    assert np.degrees(np.abs(error_rad(found.start_R_end[0], turn)).max()) < 0.1


def test_black_frames_are_missed_and_said(panned):
    _, frames = panned
    black = Frame(2, frames[2].t_s, np.zeros_like(frames[2].gray))
    broken = [*frames[:2], black, *frames[3:]]
    found = frame_rotations(broken, CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig())
    assert found.missed == 2
    np.testing.assert_allclose(found.start_s, [0.0, 0.15, 0.2])


def test_a_lens_is_taken_out():
    """A scene far away through a barrel lens: the picture is bent, the turn is not."""
    lens = Camera(
        model="opencv",
        width=640,
        height=480,
        fx=500.0,
        fy=500.0,
        cx=320.0,
        cy=240.0,
        distortion=(-0.2, 0.03, 0.0, 0.0),
    )
    flat = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    turn, rng = [0.03, -0.05, 0.08], np.random.default_rng(0)
    R = Rotation.from_rotvec(turn).as_matrix()
    uv = rng.uniform((60, 60), (580, 420), (200, 2))
    rays = np.column_stack([(uv - flat.K[:2, 2]) / 500.0, np.ones(200)]) @ R
    moved = rays[:, :2] / rays[:, 2:] * 500.0 + flat.K[:2, 2]
    bent = [distort(lens, pixels) for pixels in (uv, moved)]
    assert (
        np.degrees(np.abs(error_rad(relative_rotation(flat.K, *bent, RotationConfig())[0], turn)).max())
        > 0.05
    )

    picture = texture()
    undistorted = [view(picture, rotation, flat) for rotation in (np.eye(3), R)]
    grid = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1).reshape(-1, 2)
    at = undistort(lens, grid).astype(np.float32).reshape(480, 640, 2)
    images = [cv2.remap(image, at, None, cv2.INTER_CUBIC) for image in undistorted]
    frames = [Frame(i, 0.05 * i, image) for i, image in enumerate(images)]
    found = frame_rotations(frames, lens, TrackingConfig(), np.random.default_rng(0), RotationConfig())
    assert np.degrees(np.abs(error_rad(found.start_R_end[0], turn)).max()) < 0.03


def test_where_counts_the_others_as_missed():
    eye = np.tile(np.eye(3), (3, 1, 1))
    turns = RelativeRotations(
        start_s=np.arange(3.0), end_s=np.arange(3.0) + 1, start_R_end=eye, covariance=eye, missed=2
    )
    kept = turns.where(np.array([True, False, True]))
    assert len(kept) == 2 and kept.missed == 3
    assert kept.start_s.tolist() == [0.0, 2.0]
