import cv2
import numpy as np
import pytest
from textured_room import images

from vgps.config import TrackingConfig
from vgps.tracking.corners import harris_maxima, is_shown, new_corners

CONFIG = TrackingConfig(min_distance_px=12)
NONE = np.zeros((0, 2))


@pytest.fixture(scope="module")
def gray():
    return images(1)[0]


def corners(gray, followed=NONE, count=60, seed=0):
    return new_corners(gray, followed, count, CONFIG, np.random.default_rng(seed))


def cells(uv):
    return [tuple(cell) for cell in (uv // 12).astype(int).tolist()]


def test_harris_finds_the_corners_of_a_square():
    square = np.zeros((100, 120), np.uint8)
    square[30:70, 40:90] = 200
    uv, _ = harris_maxima(square, TrackingConfig(harris_quality=0.1))
    for corner in ([40, 30], [89, 30], [40, 69], [89, 69]):
        assert np.abs(uv - corner).max(axis=1).min() <= 2
    assert np.abs(uv[:, None] - [[40, 30], [89, 30], [40, 69], [89, 69]]).max(axis=2).min(axis=1).max() <= 2


@pytest.mark.slow
def test_maxima_are_those_of_their_neighbours_above_the_threshold_strongest_first(gray):
    uv, strength = harris_maxima(gray, TrackingConfig(harris_quality=0.01))
    response = cv2.cornerHarris(gray, 3, 3, 0.04)
    expected = {
        (u, v): response[v, u]
        for v in range(10, 230)
        for u in range(10, 310)
        if response[v, u] == response[v - 1 : v + 2, u - 1 : u + 2].max()
        and response[v, u] > 0.01 * response.max()
    }
    assert len(expected) > 50
    assert {(u, v): r for (u, v), r in zip(uv.astype(int).tolist(), strength, strict=True)} == {
        (u, v): pytest.approx(r) for (u, v), r in expected.items()
    }
    assert np.all(np.diff(strength) <= 0)


def test_an_image_without_texture_has_no_corners(gray):
    assert len(corners(np.full_like(gray, 90))) == 0


def test_a_cell_gives_its_strongest_corner(gray):
    uv, strength = harris_maxima(gray, CONFIG)
    strongest = {}
    for cell, at, response in zip(cells(uv), uv.tolist(), strength, strict=True):
        strongest[cell] = max(strongest.get(cell, (0.0, None)), (response, at))
    everywhere = corners(gray, count=10_000)
    assert sorted(cells(everywhere)) == sorted(strongest)
    assert sorted(everywhere.tolist()) == sorted(at for _, at in strongest.values())


def test_corners_keep_out_of_the_cells_of_followed_features(gray):
    first = corners(gray, count=60)
    second = corners(gray, first, count=60, seed=1)
    assert len(first) == len(second) == 60
    assert not set(cells(first)) & set(cells(second))


def test_followed_features_outside_the_image_block_nothing(gray):
    outside = np.array([[-30.0, 50.0], [400.0, 50.0], [100.0, -20.0], [100.0, 900.0]])
    np.testing.assert_array_equal(corners(gray, outside), corners(gray))


@pytest.mark.parametrize("count", [0, -3, 1, 25])
def test_no_more_corners_than_asked_for(gray, count):
    assert corners(gray, count=count).shape == (max(count, 0), 2)


def test_corners_cover_the_image_though_one_part_has_the_best_texture(gray):
    """The contrast of the left half is twice that of the right, and so it has the strongest corners."""
    faint = gray.copy()
    faint[:, 160:] = 64 + gray[:, 160:] // 2
    strongest = harris_maxima(faint, CONFIG)[0][:40]
    assert np.mean(strongest[:, 0] < 160) > 0.9
    assert 0.3 < np.mean(corners(faint, count=40)[:, 0] < 160) < 0.7


def test_no_corner_is_taken_where_a_mask_hides_the_scene(gray):
    mask = np.zeros(gray.shape, dtype=bool)
    mask[:, gray.shape[1] // 2 :] = True
    uv = new_corners(gray, NONE, 60, CONFIG, np.random.default_rng(0), mask)
    assert len(uv) > 10 and uv[:, 0].min() >= gray.shape[1] // 2


def test_a_mask_shows_pixels_by_their_nearest_neighbour_and_all_outside_the_image():
    mask = np.array([[True, False], [False, True]])
    uv = np.array([[0.4, 0.0], [0.6, 0.0], [1.0, 0.6], [-1.0, 0.0], [0.0, 2.0], [np.nan, 0.0]])
    assert is_shown(mask, uv).tolist() == [True, False, True, True, True, True]
    assert is_shown(None, uv).all()


@pytest.mark.filterwarnings("error")
def test_places_that_no_integer_holds_are_outside_a_mask():
    mask = np.array([[True, False, True], [True, True, True]])
    uv = np.array([[1.2, 0.1], [np.nan, np.nan], [np.inf, -np.inf], [1e30, 0.0], [-0.9, 0.0], [2.4, 1.4]])
    assert is_shown(mask, uv).tolist() == [False, True, True, True, True, True]
