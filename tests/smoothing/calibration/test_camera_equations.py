"""Tests of the normal equations of the calibration."""

from dataclasses import replace

import numpy as np
import pytest

from vgps.camera import distort, undistort
from vgps.model import Camera
from vgps.smoothing.calibration.camera_equations import calibration_jacobian, changed_camera, parameter_count

PINHOLE = Camera(model="pinhole", width=640, height=480, fx=500.0, fy=510.0, cx=321.0, cy=238.0)
BROWN = replace(PINHOLE, model="opencv", distortion=(-0.25, 0.08, 1e-3, -5e-4))
FISHEYE = replace(PINHOLE, model="fisheye", fx=300.0, fy=300.0, distortion=(-0.02, 0.004, 0.0, 0.0))
TSAI = replace(PINHOLE, model="tsai", distortion=(0.01, 1e-4), pixel_mm=(0.01, 0.01))


@pytest.mark.parametrize("camera", [PINHOLE, BROWN, FISHEYE, TSAI], ids=lambda camera: camera.model)
def test_the_jacobian_is_that_of_undistorting_the_pixels_of_the_picture_again(camera):
    rng, size = np.random.default_rng(0), parameter_count(camera)
    uv = undistort(camera, rng.uniform((40, 40), (600, 440), (50, 2)))
    raw, rays = distort(camera, uv), rng.uniform(-0.5, 0.5, (2, 50))
    jacobian = calibration_jacobian(camera, rays, uv, size)
    for k, step in enumerate(np.diag([1e-5, 1e-3, 1e-3, 1e-5, 1e-5][:size])):
        ends = [changed_camera(camera, sign * step) for sign in (1.0, -1.0)]
        r = [rays * [[c.fx], [c.fy]] + [[c.cx], [c.cy]] - undistort(c, raw).T for c in ends]
        np.testing.assert_allclose(jacobian[k], (r[0] - r[1]) / (2.0 * step.sum()), rtol=1e-4, atol=1e-4)
