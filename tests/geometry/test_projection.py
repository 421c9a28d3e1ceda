import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vgps.geometry import largest_angle_rad, project, reprojection_inliers, triangulate, world_rays

K = np.array([[500.0, 0, 320], [0, 510, 240], [0, 0, 1]])


def pose(rotation_vector, centre):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = Rotation.from_rotvec(rotation_vector).as_matrix(), centre
    return out


def test_project_agrees_with_opencv():
    rng = np.random.default_rng(0)
    T = pose([0.1, -0.2, 0.3], [1.0, 2.0, -3.0])
    points = rng.uniform(-2, 2, (20, 3)) @ T[:3, :3].T + T[:3, 3] + 8.0 * T[:3, 2]
    R = T[:3, :3].T
    expected, _ = cv2.projectPoints(points, cv2.Rodrigues(R)[0], -R @ T[:3, 3], K, None)
    uv, depth = project(K, T, points)
    np.testing.assert_allclose(uv, expected[:, 0], atol=1e-9)
    assert (depth > 0).all()


@pytest.mark.slow
@given(st.integers(0, 10_000), st.integers(2, 8))
def test_triangulation_finds_exact_points(seed, views):
    rng = np.random.default_rng(seed)
    cameras = np.stack(
        [pose(rng.normal(0, 0.05, 3), [0.5 * i, *rng.normal(0, 0.1, 2)]) for i in range(views)]
    )
    points = rng.uniform([-3, -3, 6], [3, 3, 20], (5, 3))
    uv = np.concatenate([np.stack([project(K, T, p[None])[0][0] for T in cameras]) for p in points])
    found, error = triangulate(K, np.tile(cameras, (5, 1, 1)), uv, views * np.arange(5))
    np.testing.assert_allclose(found, points, atol=1e-5)
    assert error.max() < 1e-5


def test_what_a_lens_stretches_counts_less():
    """Three views along a line, the last one off by 1 px in an image stretched tenfold.

    Weights W are 1, 1, 1/100. The point's two coordinates leave errors W^-1 n / (n W^-1 n), n = (1, -2, 1).
    """
    cameras = np.stack([pose(np.zeros(3), [x, 0, 0]) for x in (-1.0, 0.0, 1.0)])
    uv = np.concatenate([project(K, T, np.array([[0.0, 0.0, 10.0]]))[0] for T in cameras])
    uv[2, 0] += 1.0
    lens = np.array([1.0, 1.0, 0.1])[:, None, None] * np.eye(2)
    point, error = triangulate(K, cameras, uv, np.array([0]), lens=lens)
    np.testing.assert_allclose(error, np.array([1.0, 2.0, 10.0]) / 105.0, rtol=1e-3)
    agree = reprojection_inliers(K, cameras[1], point.repeat(3, axis=0), np.full((3, 2), 245.0), 20.0, lens)
    np.testing.assert_array_equal(agree, [False, False, True])


def test_a_point_behind_a_camera_has_no_finite_error():
    cameras = np.stack([pose(np.zeros(3), [0, 0, 0]), pose([0, np.pi, 0], [1.0, 0, 0])])
    uv = np.array([[320.0, 240.0], [300.0, 240.0]])
    _, error = triangulate(K, cameras, uv, np.array([0]))
    assert np.isinf(error).any()


def test_largest_angle_by_hand():
    cameras = np.stack([pose(np.zeros(3), [x, 0, 0]) for x in (0.0, 1.0, 2.0)])
    uv = np.concatenate([project(K, T, np.array([[1.0, 0, 10.0]]))[0] for T in cameras])
    angle = largest_angle_rad(world_rays(K, cameras, uv), np.array([0]))
    np.testing.assert_allclose(angle, 2 * np.arctan(0.1), rtol=1e-9)
