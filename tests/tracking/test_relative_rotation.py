from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vgps.camera import distort, undistort
from vgps.config import RotationConfig, TrackingConfig
from vgps.geometry.angular_rates import RelativeRotations
from vgps.model import Camera, Frame
from vgps.tracking.relative_rotation import frame_rotations, relative_rotation

CAMERA = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.0, cy=240.0)
SIDEWAYS, AHEAD, NONE = (0.4, 0.05, 0.0), (0.02, -0.03, 0.6), (0.0, 0.0, 0.0)


def two_views(rotvec, move, noise_px=0.0, seed=0, count=150):
    """Pixels of points 4 to 40 m away before and after the camera rotated and moved."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform((20, 20), (620, 460), (count, 2))
    depth = rng.uniform(4.0, 40.0, count)
    points = np.column_stack([(uv - CAMERA.K[:2, 2]) / (500.0, 510.0), np.ones(count)]) * depth[:, None]
    # first_R_second takes coordinates of the second camera to the first's
    second = (points - move) @ Rotation.from_rotvec(rotvec).as_matrix()
    moved = second[:, :2] / second[:, 2:] * (500.0, 510.0) + CAMERA.K[:2, 2]
    return uv, moved + noise_px * rng.normal(size=moved.shape)


def error_rad(found, rotvec):
    return Rotation.from_matrix(Rotation.from_rotvec(rotvec).as_matrix().T @ found).as_rotvec()


def test_the_direction_of_a_pan_by_hand():
    """A pan to the right, about y (down): what was in the centre moves to the left by f tan(angle)."""
    angle = 0.1
    uv, moved = two_views([0, angle, 0], NONE)
    middle = two_views([0, angle, 0], NONE, count=1)
    assert middle[1][0, 0] < middle[0][0, 0]
    first_R_second, _ = relative_rotation(CAMERA.K, uv, moved, RotationConfig())
    # the second camera's forward axis as the first sees it points to the right
    np.testing.assert_allclose(first_R_second[:, 2], [np.sin(angle), 0, np.cos(angle)], atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("move", [SIDEWAYS, AHEAD, NONE], ids=["sideways", "ahead", "none"])
@settings(max_examples=15, deadline=None)
@given(rotvec=st.tuples(*[st.floats(-0.12, 0.12)] * 3))
def test_a_rotation_is_exact_however_the_camera_moves(move, rotvec):
    first_R_second, _ = relative_rotation(CAMERA.K, *two_views(rotvec, move), RotationConfig())
    assert np.abs(error_rad(first_R_second, rotvec)).max() < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("move", [SIDEWAYS, AHEAD, NONE], ids=["sideways", "ahead", "none"])
def test_the_covariance_is_that_of_many_samples(move):
    """Squared errors in units of the covariance have a mean of 3."""
    rotvec, squared = [0.02, -0.03, 0.01], []
    for seed in range(40):
        found, covariance = relative_rotation(CAMERA.K, *two_views(rotvec, move, 0.3, seed), RotationConfig())
        error = error_rad(found, rotvec)
        squared.append(error @ np.linalg.solve(covariance, error))
    assert 1.0 < np.mean(squared) < 6.0


def test_a_third_of_wrong_matches_does_no_harm():
    rotvec = [0.02, -0.03, 0.01]
    uv, moved = two_views(rotvec, SIDEWAYS, 0.2, 3)
    moved[::3] += np.random.default_rng(4).uniform(-40, 40, moved[::3].shape)
    found, _ = relative_rotation(CAMERA.K, uv, moved, RotationConfig())
    assert np.degrees(np.abs(error_rad(found, rotvec)).max()) < 0.1


def test_rows_with_nan_are_ignored():
    uv, moved = two_views([0.02, 0, 0], SIDEWAYS)
    moved[::4] = np.nan
    found, _ = relative_rotation(CAMERA.K, uv, moved, RotationConfig())
    assert np.abs(error_rad(found, [0.02, 0, 0])).max() < 1e-5


def test_too_few_features_and_no_rigid_scene_give_none():
    uv, moved = two_views([0.02, 0, 0], SIDEWAYS)
    assert relative_rotation(CAMERA.K, uv[:20], moved[:20], RotationConfig()) is None
    assert relative_rotation(CAMERA.K, uv, np.full_like(moved, np.nan), RotationConfig()) is None
    anywhere = np.random.default_rng(99).uniform(0, 480, moved.shape)
    assert relative_rotation(CAMERA.K, uv, anywhere, RotationConfig()) is None


def texture(seed=5):
    """An image with detail of every size, larger than a frame."""
    rng = np.random.default_rng(seed)
    layers = [
        cv2.GaussianBlur(rng.normal(size=(960, 1280)).astype(np.float32), (0, 0), s) * s for s in (2, 5, 12)
    ]
    return cv2.normalize(sum(layers), None, 0, 255, cv2.NORM_MINMAX)


def view(far_image, world_R_camera, camera=CAMERA):
    """What a camera sees of an image at infinity."""
    uv = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1).reshape(-1, 2)
    uv = uv.astype(np.float64)
    rays = np.column_stack([(uv - camera.K[:2, 2]) / (camera.fx, camera.fy), np.ones(len(uv))])
    seen = rays @ world_R_camera.T
    at = (seen[:, :2] / seen[:, 2:] * 500.0 + (640, 480)).astype(np.float32)
    sampled = cv2.remap(far_image, at.reshape(camera.height, camera.width, 2), None, cv2.INTER_CUBIC)
    return sampled.clip(0, 255).astype(np.uint8)


def frames_of(rotations, interval_s=0.05):
    far_image = texture()
    images = [view(far_image, R) for R in rotations]
    return [Frame(i, interval_s * i, image) for i, image in enumerate(images)]


@pytest.fixture(scope="module")
def panned():
    """Six frames with random rotations of some degrees between them."""
    rotvecs = np.random.default_rng(2).uniform(-0.06, 0.06, (5, 3))
    rotations = [np.eye(3)]
    for rotvec in rotvecs:
        rotations.append(rotations[-1] @ Rotation.from_rotvec(rotvec).as_matrix())
    return rotvecs, frames_of(rotations)


@pytest.mark.slow
def test_rotations_between_images(panned):
    rotvecs, frames = panned
    found = frame_rotations(
        iter(frames), CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig()
    )
    assert len(found) == 5 and found.missed == 0
    np.testing.assert_allclose(found.start_s, [0.0, 0.05, 0.1, 0.15, 0.2])
    np.testing.assert_allclose(found.end_s, [0.05, 0.1, 0.15, 0.2, 0.25])
    errors = [error_rad(R, rotvec) for R, rotvec in zip(found.start_R_end, rotvecs, strict=True)]
    assert np.degrees(np.abs(errors).max()) < 0.02
    sigma = np.sqrt(np.array([np.diag(covariance) for covariance in found.covariance]))
    assert sigma.min() > 1e-6 and np.degrees(sigma.max()) < 0.05


@pytest.mark.slow
def test_frames_within_the_shortest_interval_are_skipped(panned):
    rotvecs, frames = panned
    found = frame_rotations(
        frames, CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig(), min_interval_s=0.09
    )
    np.testing.assert_allclose(found.start_s, [0.0, 0.1])
    np.testing.assert_allclose(found.end_s, [0.1, 0.2])
    both = (Rotation.from_rotvec(rotvecs[0]) * Rotation.from_rotvec(rotvecs[1])).as_rotvec()
    assert np.degrees(np.abs(error_rad(found.start_R_end[0], both)).max()) < 0.05


@pytest.mark.slow
def test_a_rotation_beyond_the_search_of_a_matcher():
    """A sixth of the image's width from one frame to the next."""
    rotvec = [0.0, 0.2, 0.0]
    frames = frames_of([np.eye(3), Rotation.from_rotvec(rotvec).as_matrix()])
    found = frame_rotations(frames, CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig())
    assert len(found) == 1
    assert np.degrees(np.abs(error_rad(found.start_R_end[0], rotvec)).max()) < 0.1


@pytest.mark.slow
def test_black_frames_are_counted_as_missed(panned):
    _, frames = panned
    black = Frame(2, frames[2].t_s, np.zeros_like(frames[2].gray))
    broken = [*frames[:2], black, *frames[3:]]
    found = frame_rotations(broken, CAMERA, TrackingConfig(), np.random.default_rng(0), RotationConfig())
    assert found.missed == 2
    np.testing.assert_allclose(found.start_s, [0.0, 0.15, 0.2])


@pytest.mark.slow
def test_the_distortion_of_a_lens_is_removed():
    """A distant scene through a barrel lens: the image is distorted, the rotation is not."""
    flat = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    lens = replace(flat, model="opencv", distortion=(-0.2, 0.03, 0.0, 0.0))
    rotvec, rng = [0.03, -0.05, 0.08], np.random.default_rng(0)
    R = Rotation.from_rotvec(rotvec).as_matrix()
    uv = rng.uniform((60, 60), (580, 420), (200, 2))
    rays = np.column_stack([(uv - flat.K[:2, 2]) / 500.0, np.ones(200)]) @ R
    moved = rays[:, :2] / rays[:, 2:] * 500.0 + flat.K[:2, 2]
    distorted = [distort(lens, pixels) for pixels in (uv, moved)]
    assert (
        np.degrees(
            np.abs(error_rad(relative_rotation(flat.K, *distorted, RotationConfig())[0], rotvec)).max()
        )
        > 0.05
    )

    far_image = texture()
    undistorted = [view(far_image, rotation, flat) for rotation in (np.eye(3), R)]
    grid = np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1).reshape(-1, 2)
    at = undistort(lens, grid).astype(np.float32).reshape(480, 640, 2)
    images = [cv2.remap(image, at, None, cv2.INTER_CUBIC) for image in undistorted]
    frames = [Frame(i, 0.05 * i, image) for i, image in enumerate(images)]
    found = frame_rotations(frames, lens, TrackingConfig(), np.random.default_rng(0), RotationConfig())
    assert np.degrees(np.abs(error_rad(found.start_R_end[0], rotvec)).max()) < 0.03


def test_where_counts_the_others_as_missed():
    eye = np.tile(np.eye(3), (3, 1, 1))
    rotations = RelativeRotations(
        start_s=np.arange(3.0), end_s=np.arange(3.0) + 1, start_R_end=eye, covariance=eye, missed=2
    )
    kept = rotations.where(np.array([True, False, True]))
    assert len(kept) == 2 and kept.missed == 3
    assert kept.start_s.tolist() == [0.0, 2.0]
