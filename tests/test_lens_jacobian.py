from dataclasses import replace

import numpy as np
import pytest
from lenses import TSAI

from vgps.camera import centred_camera, undistort
from vgps.lens_jacobian import lens_jacobian
from vgps.model import Camera

SIZE = (640, 480)
FISHEYE = replace(centred_camera("fisheye", SIZE, 300.0, (-0.01, 0.02)), fy=305.0)
BROWN = replace(centred_camera("opencv", SIZE, 500.0), distortion=(-0.2, 0.05, 1e-3, -5e-4, -4e-3))


@pytest.mark.parametrize("camera", [FISHEYE, BROWN, TSAI], ids=lambda camera: camera.model)
def test_it_inverts_the_derivative_of_undistorting(camera: Camera) -> None:
    u, v = np.meshgrid(np.linspace(5, camera.width - 6, 9), np.linspace(5, camera.height - 6, 7))
    uv = np.column_stack([u.ravel(), v.ravel()])
    sides = [undistort(camera, uv + step) - undistort(camera, uv - step) for step in 1e-3 * np.eye(2)]
    inverse = np.stack(sides, axis=2) / 2e-3
    product = lens_jacobian(camera, undistort(camera, uv)) @ inverse
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(2), product.shape), atol=1e-5)


def test_the_edge_of_a_fisheye_by_hand() -> None:
    """An equidistant lens, 75 degrees off the axis: cos^2 along the radius, and a / tan(a) across it."""
    angle = np.radians(75.0)
    lens = centred_camera("fisheye", SIZE, 300.0)
    uv = undistort(lens, [[lens.cx + 300.0 * angle, lens.cy]])
    expected = np.diag([np.cos(angle) ** 2, angle / np.tan(angle)])
    np.testing.assert_allclose(lens_jacobian(lens, uv), [expected], atol=1e-7)
    assert lens_jacobian(lens, np.zeros((0, 2))).shape == (0, 2, 2)


def test_a_lens_with_little_distortion_counts_as_a_pinhole() -> None:
    centre = np.array([[320.0, 240.0]])
    assert lens_jacobian(replace(BROWN, model="pinhole", distortion=()), centre) is None
    assert lens_jacobian(centred_camera("opencv", SIZE, 500.0, (0.02, 0.0)), centre) is None
    assert lens_jacobian(centred_camera("opencv", SIZE, 500.0, (0.2, 0.0)), centre) is not None


def test_beyond_the_end_of_a_lens_nothing_counts() -> None:
    folding = centred_camera("opencv", SIZE, 500.0, (-0.4, 0.0))
    np.testing.assert_array_equal(lens_jacobian(folding, [[1200.0, 240.0]]), np.zeros((1, 2, 2)))
