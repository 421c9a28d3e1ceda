"""A lens from pairs of views: recovered from far away within its sigmas, and not where nothing shows it."""

import numpy as np
import pytest

from vgps.camera_calibration.lens import parameters_of
from vgps.camera_calibration.two_view import LensPrior, fit_lens, noise_of, start_of_pairs
from vgps.model import Camera

pytestmark = pytest.mark.slow

SIZE = {"width": 640, "height": 480, "cx": 325.0, "cy": 236.0}
NARROW = Camera(model="opencv", fx=500.0, fy=500.0, distortion=(-0.12, 0.05, 0.0, 0.0), **SIZE)
WIDE = Camera(model="fisheye", fx=280.0, fy=280.0, distortion=(0.04, -0.005, 0.0, 0.0), **SIZE)
SIGMA = np.array([0.4, 8.0, 8.0, 0.2, 0.1])


def fitted(pairs, camera, off=0.3, model=None):
    """Fit from a focal length that is wrong by a factor exp(off)."""
    mean = np.array([np.log(camera.fx) + off, 319.5, 239.5, 0.0, 0.0])
    prior = LensPrior(model or camera.model, mean, SIGMA)
    rough = fit_lens(pairs, prior, mean, 0.5, 40)
    return fit_lens(pairs, prior, rough.parameters, 0.5, 40)  # pairs that began badly begin again


@pytest.mark.parametrize(("camera", "off"), [(NARROW, 0.3), (WIDE, -0.3)], ids=["narrow", "wide"])
def test_a_lens_is_recovered_from_far_away(pairs, camera, off):
    seen = pairs(camera)
    fit = fitted(seen, camera, off)
    # the information is that of a noise of 0.5 px; that of the pairs is 0.2
    sigma = np.sqrt(np.diag(np.linalg.inv(fit.information))) * 0.2 / 0.5
    error = fit.parameters - parameters_of(camera)
    assert np.all(np.abs(error) < 4 * sigma), (error / sigma).tolist()
    assert abs(error[0]) < 0.01
    assert noise_of(seen, fit) == pytest.approx(0.2, rel=0.35)


def test_the_right_model_costs_less(pairs):
    seen = pairs(WIDE)
    assert fitted(seen, WIDE, 0.0).cost < fitted(seen, WIDE, 0.0, model="opencv").cost


def test_a_camera_that_never_turns_does_not_show_its_focal_length(pairs):
    fit = fitted(pairs(NARROW, turn_deg=0.0), NARROW)
    turning = fitted(pairs(NARROW), NARROW)
    sigma, other = (np.sqrt(np.linalg.inv(each.information)[0, 0]) for each in (fit, turning))
    assert sigma > 5 * other


def test_the_geometry_of_pairs_is_found_without_a_start(pairs):
    seen = pairs(WIDE, noise_px=0.0)
    prior = LensPrior("fisheye", parameters_of(WIDE), SIGMA)
    start = start_of_pairs(seen, prior, parameters_of(WIDE), 0.5)
    assert noise_of(seen, start) < 0.05  # wrong matches pull a little
    np.testing.assert_allclose(np.linalg.det(start.rotation), 1.0)
