import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.localization.template_matching import cross_correlations, match_templates

RNG = np.random.default_rng(7)
IMAGE = (128 + 40 * cv2.GaussianBlur(RNG.normal(size=(120, 160)), (0, 0), 2.0) * 5).astype(np.float32)


def cut(u, v, side=15):
    """A template centred at a place between the pixels."""
    return cv2.getRectSubPix(IMAGE, (side, side), (float(u), float(v)))


@settings(max_examples=40)
@given(st.floats(30, 130), st.floats(30, 90), st.floats(-6, 6), st.floats(-6, 6))
def test_positions_have_subpixel_precision(u, v, off_u, off_v):
    found = match_templates(IMAGE, cut(u, v)[None], np.array([[u + off_u, v + off_v]]), np.array([8.0]))
    # a template from halfway between pixels is blurred: 0.54 px and 0.926 at the worst place of this picture
    np.testing.assert_allclose(found.uv_px, [[u, v]], atol=0.6)
    assert found.correlation[0] > 0.9


def test_most_positions_are_within_a_tenth_of_a_pixel():
    rng = np.random.default_rng(0)
    uv, off = rng.uniform((30, 30), (130, 90), (400, 2)), rng.uniform(-6, 6, (400, 2))
    found = match_templates(IMAGE, np.stack([cut(*place) for place in uv]), uv + off, np.full(400, 8.0))
    assert np.median(np.linalg.norm(found.uv_px - uv, axis=1)) < 0.1
    assert np.mean(found.correlation > 0.95) > 0.99


def test_brightness_and_contrast_do_not_matter():
    found = match_templates(IMAGE, 0.3 * cut(80, 60)[None] + 100, np.array([[83.0, 58.0]]), np.array([6.0]))
    np.testing.assert_allclose(found.uv_px, [[80, 60]], atol=0.1)
    assert found.correlation[0] == pytest.approx(1, abs=1e-4)


def test_a_template_is_not_searched_beyond_its_window():
    found = match_templates(IMAGE, cut(80, 60)[None], np.array([[90.0, 60.0]]), np.array([5.0]))
    assert np.abs(found.uv_px - (90, 60)).max() <= 5.5
    assert found.correlation[0] < 0.95


def test_every_template_has_its_own_window():
    templates = np.array([cut(50, 50), cut(100, 70)])
    predicted = np.array([[56.0, 50.0], [106.0, 70.0]])
    found = match_templates(IMAGE, templates, predicted, np.array([7.0, 2.0]))
    np.testing.assert_allclose(found.uv_px[0], [50, 50], atol=0.1)
    assert np.abs(found.uv_px[1] - (106, 70)).max() <= 2.5


@pytest.mark.parametrize("place", [(-30.0, 60.0), (500.0, 60.0), (np.nan, np.nan), (1e12, 0.0)])
def test_outside_the_image_there_is_nothing(place):
    found = match_templates(IMAGE, cut(80, 60)[None], np.array([place]), np.array([6.0]))
    assert found.correlation[0] == -1


def test_a_template_without_contrast_matches_nothing():
    flat = np.full((1, 15, 15), 90, np.float32)
    assert match_templates(IMAGE, flat, np.array([[80.0, 60.0]]), np.array([6.0])).correlation[0] == -1
    faint = flat + 1.5 * RNG.normal(size=(1, 15, 15)).astype(np.float32)
    found = match_templates(IMAGE, faint, np.array([[80.0, 60.0]]), np.array([6.0]), min_contrast=3.0)
    assert found.correlation[0] == -1


def test_near_the_border_the_window_is_cut():
    found = match_templates(IMAGE, cut(9, 60)[None], np.array([[5.0, 60.0]]), np.array([8.0]))
    np.testing.assert_allclose(found.uv_px, [[9, 60]], atol=0.1)


@settings(max_examples=30)
@given(st.integers(1, 5), st.integers(0, 2**31), st.floats(1, 60))
def test_correlations_equal_those_of_opencv(places, seed, contrast):
    rng = np.random.default_rng(seed)
    windows = rng.normal(120, contrast, (4, 15 + places, 15 + places)).astype(np.float32)
    templates = rng.normal(90, 30, (4, 15, 15)).astype(np.float32)
    expected = [
        cv2.matchTemplate(w, t, cv2.TM_CCOEFF_NORMED) for w, t in zip(windows, templates, strict=True)
    ]
    np.testing.assert_allclose(cross_correlations(windows, templates), expected, atol=1e-4)


def test_a_window_without_contrast_correlates_with_nothing():
    out = cross_correlations(np.full((1, 17, 17), 200, np.float32), cut(80, 60)[None])
    np.testing.assert_allclose(out, 0, atol=1e-3)


@pytest.mark.parametrize("radius", [3.0, 8.0])
def test_small_and_large_windows_give_the_same_positions(radius):
    # small ones by sums over all at once, large ones one by one
    places = np.array([[50.3, 50.6], [100.2, 70.9], [80.0, 60.0]])
    templates = np.array([cut(u, v) for u, v in places])
    found = match_templates(IMAGE, templates, np.round(places) + np.array([1, -1]), np.full(3, radius))
    np.testing.assert_allclose(found.uv_px, places, atol=0.1)
