import cv2
import numpy as np
import pytest
from synthetic_landmarks import CAMERA, random_poses

from vgps.landmarks.patches import Pyramid, patch_in_image, plane_axes


def image(rng: np.random.Generator) -> np.ndarray:
    return cv2.GaussianBlur(rng.integers(0, 256, (240, 320)).astype(np.float32), (0, 0), 1.5)


def test_a_template_is_the_image_where_it_was_taken() -> None:
    gray = np.round(image(np.random.default_rng(0)))
    patch = Pyramid(gray, 3).sample(np.array([[100.0, 60.0], [7.0, 200.0]]), 15)
    assert patch.shape == (2, 3, 15, 15) and patch.dtype == np.uint8
    np.testing.assert_array_equal(patch[0, 0], gray[53:68, 93:108])
    np.testing.assert_array_equal(patch[1, 0], gray[193:208, 0:15])


def test_between_pixels_it_is_interpolated() -> None:
    v, u = np.mgrid[:240, :320].astype(np.float32)
    ramp = u / 2 + v / 4
    patch = Pyramid(ramp, 1).sample(np.array([[100.3, 60.8]]), 5)[0, 0]
    offset = np.arange(-2, 3)
    expected = (100.3 + offset[None]) / 2 + (60.8 + offset[:, None]) / 4
    np.testing.assert_allclose(patch, expected, atol=0.51)


def test_a_coarser_level_covers_twice_the_width_and_has_no_finer_detail() -> None:
    v, u = np.mgrid[:240, :320].astype(np.float32)
    wave = (128 + 100 * np.sin(2 * np.pi * u / 32)).astype(np.float32)
    patch = Pyramid(wave, 3).sample(np.array([[160.0, 120.0]]), 15)[0]
    for level in range(3):
        column = 160 + 2**level * np.arange(-7, 8)
        damped = np.exp(-2 * (np.pi * 0.5 * 2**level / 32) ** 2) if level else 1.0
        expected = 128 + 100 * damped * np.sin(2 * np.pi * column / 32)
        np.testing.assert_allclose(patch[level, 7], expected, atol=1.5)
    checks = (255 * ((u + v) % 2)).astype(np.float32)
    assert np.ptp(Pyramid(checks, 3).sample(np.array([[160.0, 120.0]]), 15)[0, 1:]) <= 4


def test_many_patches_at_once_are_the_same_as_one_by_one() -> None:
    rng = np.random.default_rng(1)
    pyramid = Pyramid(image(rng), 2)
    uv = rng.uniform(20, 200, (5000, 2))
    together = pyramid.sample(uv, 7)
    for row in (0, 4570, 4571, 4999):
        np.testing.assert_array_equal(together[row], pyramid.sample(uv[row : row + 1], 7)[0])
    assert pyramid.sample(uv[:0], 7).shape == (0, 2, 7, 7)


def test_the_axes_are_one_pixel_wide() -> None:
    rng = np.random.default_rng(2)
    poses = random_poses(rng, 10)
    uv, depth = rng.uniform(20, 200, (10, 2)), rng.uniform(3, 90, 10)
    column, row = plane_axes(poses, CAMERA, depth)
    for pose, at, z, right, down in zip(poses, uv, depth, column, row, strict=True):
        ray = np.array([(at[0] - CAMERA.cx) / CAMERA.fx, (at[1] - CAMERA.cy) / CAMERA.fy, 1.0])
        point = pose[:3, :3] @ (z * ray) + pose[:3, 3]
        x, y, depth_there = pose[:3, :3].T @ (point + 3 * right - 2 * down - pose[:3, 3])
        there = (
            CAMERA.fx * x / depth_there + CAMERA.cx,
            CAMERA.fy * y / depth_there + CAMERA.cy,
        )
        assert there == pytest.approx((at[0] + 3, at[1] - 2), abs=1e-9)


def test_room_for_a_patch() -> None:
    uv = np.array([[7.0, 7.0], [6.9, 100.0], [312.0, 232.0], [312.1, 100.0], [100.0, 232.5]])
    assert patch_in_image(uv, CAMERA, 15).tolist() == [True, False, True, False, False]
