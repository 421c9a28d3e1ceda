import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.localization.motion_blur import blur_along_rows, blur_grids, pixel_offsets

motions = st.lists(st.tuples(st.floats(-60, 60), st.floats(-60, 60)), min_size=1, max_size=6).map(np.array)


def blurred(image, blur_px, side):
    """Templates around the middle of an image, sampled on the grids and blurred."""
    grids = blur_grids(blur_px, side)
    at = grids.image_R_grid @ pixel_offsets(grids.height, grids.width)
    u, v = (at[:, axis].astype(np.float32) + image.shape[1 - axis] // 2 for axis in (0, 1))
    sampled = cv2.remap(image, u, v, cv2.INTER_LINEAR)
    return blur_along_rows(sampled.reshape(-1, grids.height, grids.width), grids)


@pytest.mark.slow
@given(motions, st.sampled_from([5, 15, 21]))
def test_a_rotated_grid_covers_the_template_and_its_motion(blur_px, side):
    grids = blur_grids(blur_px, side)
    rotation = grids.image_R_grid
    np.testing.assert_allclose(
        rotation.transpose(0, 2, 1) @ rotation, np.tile(np.eye(2), (len(rotation), 1, 1)), atol=1e-6
    )
    np.testing.assert_allclose(np.linalg.det(rotation), 1)
    # the corners of the template, half a motion on and back, in the grid's own axes
    corners = (side // 2) * np.array([[-1, -1, 1, 1], [-1, 1, -1, 1.0]])
    reach = np.abs(rotation.transpose(0, 2, 1) @ corners).max(axis=2)
    assert (reach[:, 0] + grids.length_px / 2 + 1 <= grids.width // 2 + 0.5).all()
    assert (reach[:, 1] + 1 <= grids.height // 2).all()


@pytest.mark.slow
@given(motions, st.floats(0, 255))
def test_a_uniform_image_is_unchanged(blur_px, grey):
    out = blurred(np.full((161, 161), grey, np.float32), blur_px, 15)
    np.testing.assert_allclose(out, grey, atol=1e-2)


def test_without_motion_a_template_is_unchanged():
    image = np.random.default_rng(0).uniform(0, 255, (41, 41)).astype(np.float32)
    out = blurred(image, np.array([[0.0, 0.0], [0.4, -0.6]]), 7)
    np.testing.assert_allclose(out, np.tile(image[17:24, 17:24], (2, 1, 1)), atol=1e-3)


def test_three_pixels_sideways_by_hand():
    image = np.zeros((41, 41), np.float32)
    image[20, 20] = 3.0
    expected = np.zeros((5, 5))
    expected[2, 1:4] = 1.0
    np.testing.assert_allclose(blurred(image, np.array([[3.0, 0.0]]), 5)[0], expected, atol=1e-5)


def test_two_pixels_down_by_hand():
    # half a pixel of the line falls on each neighbour, one whole pixel on the middle
    image = np.zeros((41, 41), np.float32)
    image[20, 20] = 4.0
    out = blurred(image, np.array([[0.0, 2.0]]), 5)[0]
    np.testing.assert_allclose(out[:, 2], [0, 1, 2, 1, 0], atol=1e-5)
    assert np.abs(np.delete(out, 2, axis=1)).max() < 1e-5


@pytest.mark.parametrize("motion", [(12.0, 0.0), (0.0, -9.0), (7.3, 5.1), (-4.2, 16.7), (25.0, -24.0)])
def test_blur_is_the_mean_of_shifted_images(motion):
    rng = np.random.default_rng(3)
    image = cv2.GaussianBlur(rng.normal(size=(101, 101)), (0, 0), 2.0).astype(np.float32)
    shifts = (np.arange(400) + 0.5) / 400 - 0.5
    moved = [
        cv2.warpAffine(image, np.float32([[1, 0, s * motion[0]], [0, 1, s * motion[1]]]), (101, 101))
        for s in shifts
    ]
    expected = np.mean(moved, axis=0)[43:58, 43:58]
    out = blurred(image, np.array([motion]), 15)[0]
    assert np.corrcoef(out.ravel(), expected.ravel())[0, 1] > 0.995
    assert np.abs(out - expected).max() < 0.1 * np.abs(image).max()


def test_every_template_is_blurred_along_its_own_motion():
    image = np.random.default_rng(4).uniform(0, 255, (161, 161)).astype(np.float32)
    both = np.array([[9.0, 3.0], [-2.0, 30.0]])
    alone = np.concatenate([blurred(image, both[k : k + 1], 15) for k in (0, 1)])
    np.testing.assert_allclose(blurred(image, both, 15), alone, atol=0.5)
