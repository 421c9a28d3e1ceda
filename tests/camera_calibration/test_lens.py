"""Rays of a lens against OpenCV's models, and their Jacobians against differences."""

import numpy as np
import pytest

from vgps.camera import project
from vgps.camera_calibration.lens import angles, parameters_of, rays, with_parameters
from vgps.model import Camera

SIZE = {"width": 640, "height": 480, "fx": 300.0, "fy": 300.0, "cx": 322.0, "cy": 238.0}
LENSES = [
    Camera(model="opencv", distortion=(-0.1, 0.02, 0.0, 0.0), **SIZE),
    Camera(model="fisheye", distortion=(0.05, -0.01, 0.0, 0.0), **SIZE),
]
PIXELS = np.random.default_rng(1).uniform((0, 0), (639, 479), (50, 2))


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera.model)
def test_opencv_projects_the_rays_back(camera):
    ray, _, holds = rays(camera.model, parameters_of(camera), PIXELS)
    assert holds.all()
    np.testing.assert_allclose(np.linalg.norm(ray, axis=1), 1.0)
    np.testing.assert_allclose(project(camera, ray), PIXELS, atol=1e-6)


@pytest.mark.parametrize("camera", LENSES, ids=lambda camera: camera.model)
def test_jacobian_agrees_with_differences(camera):
    parameters, step = parameters_of(camera), 1e-4
    _, jacobian, _ = rays(camera.model, parameters, PIXELS)
    for axis, d in enumerate(step * np.eye(2)):
        ahead, behind = (rays(camera.model, parameters, PIXELS + sign * d)[0] for sign in (1, -1))
        np.testing.assert_allclose(jacobian[:, :, axis], (ahead - behind) / (2 * step), atol=1e-9)


def test_a_fisheye_sees_beyond_a_right_angle():
    wide = parameters_of(Camera(model="fisheye", distortion=(0.0,) * 4, **SIZE | {"fx": 100.0, "fy": 100.0}))
    ray, _, _ = rays("fisheye", wide, np.array([[322.0 + 200.0, 238.0]]))
    np.testing.assert_allclose(ray, [[np.sin(2.0), 0.0, np.cos(2.0)]], atol=1e-12)
    np.testing.assert_allclose(angles("fisheye", wide, np.array([200.0])), [2.0])


def test_pixels_beyond_the_turning_point_are_told():
    folded = parameters_of(Camera(model="opencv", distortion=(-0.5, 0.0, 0.0, 0.0), **SIZE))
    # x (1 - x^2 / 2) is at most 0.544, 163 px
    _, _, holds = rays("opencv", folded, np.array([[322.0 + 150.0, 238.0], [322.0 + 200.0, 238.0]]))
    assert holds.tolist() == [True, False]


def test_parameters_make_the_camera_again():
    for camera in LENSES:
        assert with_parameters(camera, parameters_of(camera)).distortion == camera.distortion
        assert with_parameters(camera, parameters_of(camera)).fx == pytest.approx(camera.fx)
