from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lenses import TSAI

from vgps.camera import camera_fields, distort, project, turning_radius, undistort, unused_share
from vgps.model import Camera

PINHOLE = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=320.0, cy=240.0)
WIDE = replace(PINHOLE, width=848, fx=486.16, fy=486.16, cx=424.0)
CV4 = replace(WIDE, model="opencv", distortion=(-0.1435, 0.01, 0.001, -0.002))
CV5 = replace(PINHOLE, model="opencv", distortion=(-0.2, 0.05, 0.001, -0.0005, -0.004))
CV8 = replace(PINHOLE, model="opencv", distortion=(0.1, 0.05, 1e-3, -5e-4, 0.01, 0.2, 0.1, 0.01))
FISHEYE = replace(PINHOLE, model="fisheye", fx=300.0, fy=305.0, distortion=(-0.01, 0.02, -0.005, 0.001))
CAMERAS = [PINHOLE, CV4, CV5, CV8, FISHEYE, TSAI]
names = [f"{camera.model}{len(camera.distortion)}" for camera in CAMERAS]
over_cameras = pytest.mark.parametrize("camera", CAMERAS, ids=names)


def grid(camera: Camera) -> np.ndarray:
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, 13), np.linspace(0, camera.height - 1, 11))
    return np.column_stack([u.ravel(), v.ravel()])


@over_cameras
def test_every_pixel_comes_back(camera):
    flat = undistort(camera, grid(camera))
    np.testing.assert_allclose(distort(camera, flat), grid(camera), atol=1e-6)


CV8_FROM_K5 = replace(CV8, distortion=(*CV8.distortion[:5], 0.0, *CV8.distortion[6:]))


@pytest.mark.parametrize("camera", [CV4, CV5, CV8, CV8_FROM_K5], ids=["4", "5", "8", "8 without k4"])
def test_distortion_is_that_of_opencv(camera):
    flat = grid(PINHOLE)
    rays = np.column_stack([flat, np.ones(len(flat))]) @ np.linalg.inv(camera.K).T
    expected, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), camera.K, np.array(camera.distortion))
    inside = np.hypot(*rays[:, :2].T) < turning_radius(camera)
    np.testing.assert_allclose(distort(camera, flat)[inside], expected[inside, 0], rtol=0, atol=1e-9)


@over_cameras
def test_projection_agrees_with_the_undistorted_ray(camera):
    uv = grid(camera)
    rays = np.column_stack([undistort(camera, uv), np.ones(len(uv))]) @ np.linalg.inv(camera.K).T
    depths = np.linspace(0.5, 300, len(uv))[:, None]
    np.testing.assert_allclose(project(camera, rays * depths), uv, atol=1e-6)


def test_tsai_is_the_printed_equation():
    """Eq. (5)(6), Kume 2010, term by term at one pixel."""
    u, v = 700.0, 20.0
    x, y = 4.8 / (720 * 1.02) * (u - 355.0), 3.6 / 480 * (v - 238.0)
    rho = np.hypot(x, y)
    factor = 1 + 8e-3 * rho**2 + 1e-4 * rho**4
    expected = [355.0 + factor * (u - 355.0), 238.0 + factor * (v - 238.0)]
    np.testing.assert_allclose(undistort(TSAI, [[u, v]]), [expected], rtol=1e-12)


def test_opencv_distortion_is_the_documented_polynomial():
    k1, k2, p1, p2, k3 = CV5.distortion
    x, y = 0.3, -0.2
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    expected = [[500 * xd + 320, 510 * yd + 240]]
    np.testing.assert_allclose(project(CV5, [[x * 7, y * 7, 7.0]]), expected, atol=1e-9)


def test_fisheye_distortion_is_the_documented_polynomial():
    x, y = 0.9, 0.4
    r = np.hypot(x, y)
    theta = np.arctan(r)
    k = FISHEYE.distortion
    theta_d = theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)
    expected = [[300 * theta_d / r * x + 320, 305 * theta_d / r * y + 240]]
    np.testing.assert_allclose(project(FISHEYE, [[x, y, 1.0]]), expected, atol=1e-9)


def test_points_beside_and_behind_the_camera_have_no_pixel():
    assert np.isnan(project(PINHOLE, [[0, 0, -1.0], [1, 1, 0.0], [np.nan, 0, 1.0]])).all()
    np.testing.assert_allclose(project(PINHOLE, [[0.1, -0.2, 2.0]]), [[345.0, 189.0]])


def test_no_points_are_no_points():
    for camera in CAMERAS:
        assert undistort(camera, np.zeros((0, 2))).shape == (0, 2)
        assert project(camera, np.zeros((0, 3))).shape == (0, 2)


def test_a_folding_polynomial_has_no_pixel_beyond_its_turn():
    barrel = replace(PINHOLE, model="opencv", fy=500.0, distortion=(-0.4, 0.0, 0.0, 0.0))
    turn = np.sqrt(1 / (3 * 0.4))  # d/dr (r - 0.4 r^3) = 0
    assert turning_radius(barrel) == pytest.approx(turn)
    inside, outside = project(barrel, [[0.99 * turn, 0, 1], [1.01 * turn, 0, 1]])
    assert np.isfinite(inside).all()
    assert np.isnan(outside).all()
    widest = 500 * turn * (1 - 0.4 * turn**2)  # the largest radius the lens reaches, pixels
    near, beyond = undistort(barrel, [[320 + 0.95 * widest, 240], [320 + 1.05 * widest, 240]])
    assert np.isfinite(near).all()
    assert np.isnan(beyond).all()


def test_a_fisheye_ends_before_a_right_angle():
    """Equidistant, a corner 100 degrees off the axis: 85 degrees are a circle of 340 px in 640 x 480."""
    wide = replace(FISHEYE, fx=400 / np.radians(100), fy=400 / np.radians(100), distortion=(0.0,) * 4)
    inside, outside = undistort(wide, [[320.0 - 339.0, 240.0], [320.0, 240.0 + 341.0]])
    assert np.isfinite(inside).all() and np.isnan(outside).all()
    u, v = np.meshgrid(np.arange(640) - 320.0, np.arange(480) - 240.0)
    assert unused_share(wide) == pytest.approx(np.mean(np.hypot(u, v) > 340.0), abs=0.005)
    assert unused_share(PINHOLE) == unused_share(CV5) == 0.0


def test_tsai_with_a_negative_coefficient_is_not_inverted_beyond_its_turn():
    camera = replace(PINHOLE, model="tsai", fy=500.0, distortion=(-0.05, 0.0), pixel_mm=(0.01, 0.01))
    turn_px = np.sqrt(1 / (3 * 0.05)) / 0.01
    inside, outside = undistort(camera, [[320 + 0.95 * turn_px, 240], [320 + 1.05 * turn_px, 240]])
    assert np.isfinite(inside).all()
    assert np.isnan(outside).all()
    widest = turn_px * 2 / 3
    assert np.isnan(distort(camera, [[320 + 1.1 * widest, 240]])).all()


@pytest.mark.slow
@given(st.floats(0, 0.02), st.floats(0, 5e-4), st.floats(0, 720), st.floats(0, 480))
def test_tsai_inverts_exactly(k1, k2, u, v):
    camera = replace(TSAI, distortion=(k1, k2), pixel_mm=(0.0067, 0.0075))
    np.testing.assert_allclose(distort(camera, undistort(camera, [[u, v]])), [[u, v]], atol=1e-7)


def test_the_fields_are_those_of_camera_yaml():
    fields = camera_fields(TSAI)
    assert fields["distortion"] == [8e-3, 1e-4]
    assert fields["pixel_mm"] == [4.8 / 720 / 1.02, 3.6 / 480]
    assert "distortion" not in camera_fields(PINHOLE)
