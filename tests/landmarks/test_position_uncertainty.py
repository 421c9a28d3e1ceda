import numpy as np
import pytest

from vgps.landmarks.position_uncertainty import position_sigmas_m

K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])


def test_two_cameras_side_by_side() -> None:
    # depth z = f b / disparity: sigma_z = z^2 / (f b) * sqrt(2) sigma for a short base
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, 0, 3] = (-0.05, 0.05)
    point = np.array([0.0, 0.0, 10.0])
    sigma = position_sigmas_m(K, poses, np.tile(point, (2, 1)), np.array([0]), np.array([0.4]))
    assert sigma[0] == pytest.approx(10**2 / (500 * 0.1) * np.sqrt(2) * 0.4, rel=1e-3)


def test_it_is_the_spread_of_points_triangulated_from_noise() -> None:
    from vgps.geometry import project, triangulate

    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, :3, 3] = np.linspace((0, 0, 0), (2, 0.3, 1), 5)
    point, draws, sigma_px = np.array([1.0, -0.5, 12.0]), 2000, 0.5
    uv, _ = project(K, poses, np.tile(point, (5, 1))[:, None])
    noisy = np.tile(uv[:, 0], (draws, 1)) + rng.normal(scale=sigma_px, size=(5 * draws, 2))
    found, _ = triangulate(K, np.tile(poses, (draws, 1, 1)), noisy, 5 * np.arange(draws))
    largest = np.sqrt(np.linalg.eigvalsh(np.cov(found.T))[-1])
    sigma = position_sigmas_m(K, poses, np.tile(point, (5, 1)), np.array([0]), np.array([sigma_px]))
    assert sigma[0] == pytest.approx(largest, rel=0.08)


def test_one_ray_says_nothing_of_the_depth() -> None:
    pose, point = np.eye(4)[None], np.array([[0.0, 0.0, 10.0]])
    assert position_sigmas_m(K, pose, point, np.array([0]), np.array([1.0]))[0] == np.inf
