import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.landmarks.blur import blur_margin, blur_patches, motion_taps

motions = st.lists(st.tuples(st.floats(-40, 40), st.floats(-40, 40)), min_size=1, max_size=6).map(np.array)


@given(motions)
def test_the_spread_sums_to_one_and_has_the_moments_of_a_line(blur_px):
    u, v, weight = motion_taps(blur_px)
    assert (weight >= -1e-12).all()
    np.testing.assert_allclose(weight.sum(axis=1), 1)
    at = np.stack([u, v], axis=-1)
    mean = (weight[..., None] * at).sum(axis=1)
    np.testing.assert_allclose(mean, 0, atol=1e-6)
    # a line of length L has variance L^2/12 along it; whole pixels add at most a quarter in each axis
    variance = (weight[..., None] * at**2).sum(axis=1)
    assert (np.abs(variance - blur_px**2 / 12) <= 0.34).all()


@given(motions)
def test_the_margin_holds_every_tap(blur_px):
    u, v, weight = motion_taps(blur_px)
    used = weight > 0
    assert max(np.abs(u[used]).max(), np.abs(v[used]).max()) <= blur_margin(blur_px)


def test_without_motion_a_patch_stays_as_it_is():
    patches = np.random.default_rng(0).normal(size=(3, 9, 9)).astype(np.float32)
    np.testing.assert_allclose(blur_patches(patches, np.zeros((3, 2)), 7), patches[:, 1:-1, 1:-1], atol=1e-5)


def test_three_pixels_sideways_by_hand():
    patches = np.zeros((1, 9, 9), np.float32)
    patches[0, 4, 4] = 3.0
    out = blur_patches(patches, np.array([[3.0, 0.0]]), 5)
    expected = np.zeros((5, 5))
    expected[2, 1:4] = 1.0
    np.testing.assert_allclose(out[0], expected, atol=1e-6)


def test_two_pixels_down_by_hand():
    # half a pixel of the line falls on each neighbour, one whole pixel on the middle
    patches = np.zeros((1, 9, 9), np.float32)
    patches[0, 4, 4] = 4.0
    out = blur_patches(patches, np.array([[0.0, 2.0]]), 5)
    np.testing.assert_allclose(out[0][:, 2], [0, 1, 2, 1, 0], atol=1e-5)
    assert np.abs(np.delete(out[0], 2, axis=1)).max() < 1e-5


@pytest.mark.parametrize("motion", [(12.0, 0.0), (0.0, -9.0), (7.3, 5.1), (-4.2, 16.7), (25.0, -24.0)])
def test_as_direct_integration_of_shifted_images(motion):
    rng = np.random.default_rng(3)
    image = cv2.GaussianBlur(rng.normal(size=(101, 101)), (0, 0), 2.0).astype(np.float32)
    shifts = (np.arange(400) + 0.5) / 400 - 0.5
    moved = [
        cv2.warpAffine(image, np.float32([[1, 0, s * motion[0]], [0, 1, s * motion[1]]]), (101, 101))
        for s in shifts
    ]
    expected = np.mean(moved, axis=0)[43:58, 43:58]
    blur = np.array([motion])
    margin = blur_margin(blur)
    patch = image[None, 43 - margin : 58 + margin, 43 - margin : 58 + margin]
    out = blur_patches(patch, blur, 15)[0]
    assert np.corrcoef(out.ravel(), expected.ravel())[0, 1] > 0.995
    assert np.abs(out - expected).max() < 0.1 * np.abs(image).max()
