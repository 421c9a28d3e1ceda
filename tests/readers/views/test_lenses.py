import cv2
import numpy as np
import pytest

from vgps.model import Camera
from vgps.readers.views.lenses import Equirectangular, wide_fisheye

CIRCLE = Camera(
    model="fisheye",
    width=800,
    height=800,
    fx=230.0,
    fy=231.0,
    cx=399.5,
    cy=399.5,
    distortion=(0.01, -0.004, 0.001, -0.0002),
)


@pytest.mark.parametrize(
    ("ray", "pixel"),
    [
        ((0, 0, 1), (199.5, 99.5)),  # ahead: the middle
        ((2, 0, 0), (299.5, 99.5)),  # to the right: a quarter of the width further
        ((-1, 0, 1), (149.5, 99.5)),
        ((0, 1, 1), (199.5, 149.5)),  # 45 degrees down
        ((0, -1, -1), (399.5, 49.5)),  # behind and up: the right edge
        ((0, 1, 0), (199.5, 199.0)),  # straight down: no row further than the last
    ],
)
def test_an_equirectangular_picture_has_longitude_across_and_latitude_down(ray, pixel):
    lens = Equirectangular(400, 200)
    np.testing.assert_allclose(lens.pixels(np.array([ray], float)), [pixel], atol=1e-9)


def test_a_wide_fisheye_is_opencv_s_in_front_and_goes_on_behind():
    lens = wide_fisheye(CIRCLE)
    assert lens is not None
    rays = np.array([[0.1, 0.2, 1.0], [-1.5, 0.4, 1.0], [3.0, -5.0, 1.0]])
    expected = cv2.fisheye.distortPoints(
        rays[:, None, :2].copy(), CIRCLE.K, np.array(CIRCLE.distortion)
    ).reshape(-1, 2)
    np.testing.assert_allclose(lens.pixels(rays), expected, atol=1e-6)
    angles = np.radians([80.0, 89.999, 90.001, 96.0])
    u = lens.pixels(np.column_stack([np.sin(angles), np.zeros(4), np.cos(angles)]))[:, 0]
    assert (np.diff(u) > 0).all() and np.diff(u)[1] < 0.01


def test_what_is_outside_the_circle_is_not_seen():
    lens = wide_fisheye(CIRCLE)
    assert lens is not None
    beyond = np.radians(110.0)  # inside the square picture along its diagonal, outside the circle
    assert np.isnan(lens.pixels(np.array([[np.sin(beyond), np.sin(beyond), np.cos(beyond)]]))).all()
    assert np.isnan(lens.pixels(np.array([[0.0, 0.0, -1.0]]))).all()


@pytest.mark.parametrize(("degrees", "wide"), [(150, False), (178, False), (182, True), (195, True)])
def test_a_fisheye_is_wide_if_it_sees_right_angles_along_the_longer_side(degrees, wide):
    f = 400.0 / np.radians(degrees / 2)
    camera = Camera(
        model="fisheye", width=801, height=401, fx=f, fy=f, cx=400.0, cy=200.0, distortion=(0.0,) * 4
    )
    assert (wide_fisheye(camera) is not None) == wide


def test_a_fisheye_whose_polynomial_turns_back_before_right_angles_is_not_wide():
    camera = Camera(
        model="fisheye",
        width=800,
        height=800,
        fx=230.0,
        fy=230.0,
        cx=399.5,
        cy=399.5,
        distortion=(-0.2, 0.0, 0.0, 0.0),
    )
    assert wide_fisheye(camera) is None
