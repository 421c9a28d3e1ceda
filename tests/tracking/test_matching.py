import cv2
import numpy as np
import pytest

from vgps.config import TrackingConfig
from vgps.tracking.corners import new_corners
from vgps.tracking.matching import make_matcher

SHIFT = np.array([7.3, -4.6])


@pytest.fixture(scope="module")
def images():
    rng = np.random.default_rng(5)
    noise = cv2.GaussianBlur(rng.uniform(0, 255, (260, 360)).astype(np.float32), (0, 0), 2.0)
    image = cv2.normalize(noise, None, 0, 255, cv2.NORM_MINMAX)
    moved = cv2.warpAffine(
        image, np.float64([[1, 0, SHIFT[0]], [0, 1, SHIFT[1]]]), (360, 260), flags=cv2.INTER_CUBIC
    )
    return image.clip(0, 255).astype(np.uint8), moved.clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("method", "tolerance_px", "missed_px"), [("lk", 0.05, 3.0), ("lk", 0.05, 25.0), ("ssd", 0.2, 9.0)]
)
def test_a_shift_is_found_from_near_and_from_far(images, method, tolerance_px, missed_px):
    config = TrackingConfig(method=method, search_px=16)
    uv = new_corners(images[0], np.zeros((0, 2)), 80, config, np.random.default_rng(0))
    inner = np.all((uv > 30) & (uv < (330, 230)), axis=1)
    predicted = uv[inner] + SHIFT + missed_px * np.array([0.8, -0.6])
    match = make_matcher(config).match(*images, uv[inner], predicted)
    assert match.found.mean() > 0.85
    error = np.linalg.norm(match.uv_px - uv[inner] - SHIFT, axis=1)[match.found]
    assert np.median(error) < tolerance_px


@pytest.mark.parametrize("darker", [0, 1])
def test_a_picture_of_another_exposure_is_followed_as_well(images, darker):
    exposed = [(0.3 * image + 5).astype(np.uint8) if k == darker else image for k, image in enumerate(images)]
    uv = new_corners(images[0], np.zeros((0, 2)), 80, TrackingConfig(), np.random.default_rng(0))
    uv = uv[np.all((uv > 30) & (uv < (330, 230)), axis=1)]
    match = make_matcher(TrackingConfig()).match(*exposed, uv, uv + SHIFT + 3.0)
    assert match.found.mean() > 0.85
    error = np.linalg.norm(match.uv_px - uv - SHIFT, axis=1)[match.found]
    assert np.median(error) < 0.2


@pytest.mark.parametrize("method", ["lk", "ssd"])
def test_features_that_leave_the_image_or_vanish_are_not_found(images, method):
    config = TrackingConfig(method=method, search_px=16)
    matcher = make_matcher(config)
    corner = np.array([[355.0, 130.0], [100.0, 3.0]])
    assert not matcher.match(*images, corner, corner + SHIFT).found.any()
    uv = new_corners(images[0], np.zeros((0, 2)), 60, config, np.random.default_rng(0))
    black = np.zeros_like(images[1])
    assert not matcher.match(images[0], black, uv, uv).found.any()
