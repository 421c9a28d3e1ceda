"""The lens of pairs of views beside what a file states: the video decides where it shows it."""

import pickle
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from vgps.camera import centred_camera
from vgps.camera_calibration import calibrate
from vgps.camera_calibration.calibrate import fit_guesses
from vgps.camera_calibration.lens import angles, parameters_of
from vgps.camera_calibration.two_view import LensFit
from vgps.config import CameraCalibrationConfig
from vgps.model import Camera, CameraGuess

SIZE = {"width": 640, "height": 480, "cx": 325.0, "cy": 236.0}
LENSES = {
    "plain": Camera(model="opencv", fx=600.0, fy=600.0, distortion=(-0.05, 0.02, 0.0, 0.0), **SIZE),
    "fisheye": Camera(model="fisheye", fx=330.0, fy=330.0, distortion=(0.04, 0.0, 0.0, 0.0), **SIZE),
}
NARROW = replace(LENSES["plain"], fx=1500.0, fy=1500.0)  # 30 degrees from corner to corner
HALF_DIAGONAL_PX = 400.0
SETTINGS = CameraCalibrationConfig()


def once(function):
    """Return a function that keeps its results, as tests with the same pairs fit the same guesses to them."""
    kept = {}

    def found(*given):
        key = pickle.dumps(given)
        if key not in kept:
            kept[key] = function(*given)
        return kept[key]

    return found


FITTED, FIT_LENS = once(calibrate._fitted), once(calibrate.fit_lens)


@pytest.fixture(autouse=True)
def fits_are_kept(monkeypatch):
    monkeypatch.setattr(calibrate, "_fitted", FITTED)
    monkeypatch.setattr(calibrate, "fit_lens", FIT_LENS)


@pytest.fixture
def pairs(pairs):
    """Fewer pairs with two thirds of the features: fits of three guesses take long."""
    return partial(pairs, count=6, features=60)


def ray_angles(camera):
    radii = np.array([0.5, 1.0]) * HALF_DIAGONAL_PX
    return angles(camera.model, parameters_of(camera), radii)


def guesses(model, focal_px):
    """Return a stated focal length, and any lens, as a reader does."""
    stated = CameraGuess(
        camera=centred_camera(model, (640, 480), focal_px),
        focal_sigma=0.08,
        centre_sigma_px=6.4,
        distortion_sigma=(0.1, 0.1),
        source="stated",
    )
    any_lens = replace(stated, focal_sigma=0.5, distortion_sigma=(0.2, 0.1), source="any")
    return (
        stated,
        replace(any_lens, camera=centred_camera("opencv", (640, 480), 544.0)),
        replace(any_lens, camera=centred_camera("fisheye", (640, 480), 320.0)),
    )


@pytest.mark.slow
@pytest.mark.parametrize(("name", "factor"), [("plain", 1 / 1.5), ("fisheye", 1.5)])
def test_a_wrong_statement_gives_way_to_the_video(pairs, name, factor):
    camera = LENSES[name]
    found = fit_guesses(pairs(camera), guesses(camera.model, factor * camera.fx), SETTINGS)
    assert found.guess.source == "any"
    np.testing.assert_allclose(ray_angles(found.camera), ray_angles(camera), rtol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", LENSES)
def test_a_right_statement_stays(pairs, name):
    camera = LENSES[name]
    found = fit_guesses(pairs(camera), guesses(camera.model, 1.03 * camera.fx), SETTINGS)
    assert found.guess.source == "stated"
    np.testing.assert_allclose(ray_angles(found.camera), ray_angles(camera), rtol=0.01)


@pytest.mark.slow
def test_a_picture_linearised_by_the_camera_is_no_fisheye(pairs):
    camera = LENSES["plain"]
    found = fit_guesses(pairs(camera), guesses("fisheye", 0.6 * camera.fx), SETTINGS)
    np.testing.assert_allclose(ray_angles(found.camera), ray_angles(camera), rtol=0.01)


@pytest.mark.slow
def test_a_statement_that_the_video_does_not_show_stays(pairs):
    camera = LENSES["plain"]
    seen = pairs(camera, turn_deg=0.0)  # a camera that never turns
    found = fit_guesses(seen, guesses("opencv", 1.2 * camera.fx), SETTINGS)
    assert found.guess.source == "stated"


@pytest.mark.slow
def test_a_statement_that_is_off_by_two_sigmas_stays(pairs):
    camera = LENSES["plain"]
    found = fit_guesses(pairs(camera), guesses("opencv", np.exp(2.4 * 0.08) * camera.fx), SETTINGS)
    assert found.guess.source == "stated"
    np.testing.assert_allclose(ray_angles(found.camera), ray_angles(camera), rtol=0.01)


@pytest.fixture
def gives_way(monkeypatch):
    """Return whether a guess gives way to another one that gains as much in each of 30 pairs."""

    def asked(kept, other, gain, off_sigmas=0.5):
        fits = [
            LensFit(
                guess.camera.model, parameters_of(guess.camera), None, None, cost, np.diag(guess.sigmas**-2.0)
            )
            for guess, cost in ((kept, 30 * gain), (other, 0.0))
        ]
        fits[0].parameters[0] += off_sigmas * kept.focal_sigma
        monkeypatch.setattr(calibrate, "pair_losses", lambda _, fit, __: np.full(30, fit.cost / 30))
        return calibrate._contradicts(None, (kept, fits[0]), (other, fits[1]), 0.1)

    return asked


@pytest.mark.parametrize(
    ("gain", "off_sigmas", "expected"),
    [(1.5, 0.5, False), (5.0, 0.5, True), (1.5, 2.5, True), (0.0, 2.5, False)],
)
def test_a_statement_gives_way_to_more_than_pairs_that_follow_errors(gives_way, gain, off_sigmas, expected):
    """Above flat ground another focal length gained 1.3 of noise."""
    stated, other, _ = guesses("opencv", 600.0)
    assert gives_way(stated, other, gain, off_sigmas) == expected


def test_a_lens_of_which_nothing_is_stated_gives_way_to_any_significant_gain(gives_way):
    """Both lenses follow the errors alike."""
    stated, plain, fisheye = guesses("opencv", 600.0)
    assert gives_way(plain, fisheye, 1.5)
    assert not gives_way(stated, fisheye, 1.5)
    assert not gives_way(plain, fisheye, 0.05)  # 1.5 in all pairs, less than the logarithm of 20


@pytest.mark.slow
def test_a_narrow_lens_is_found_from_a_usual_one(pairs):
    _, plain, _ = guesses("opencv", NARROW.fx)
    found = fit_guesses(pairs(NARROW, noise_px=0.1), (plain,), SETTINGS)
    np.testing.assert_allclose(ray_angles(found.camera), ray_angles(NARROW), rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, -1])
def test_a_narrow_lens_is_found_whatever_is_guessed_first(pairs, order):
    both = guesses("opencv", NARROW.fx)[1:][::order]
    found = fit_guesses(pairs(NARROW, noise_px=0.1), both, SETTINGS)
    np.testing.assert_allclose(ray_angles(found.camera), ray_angles(NARROW), rtol=0.1)
