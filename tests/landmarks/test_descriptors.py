import cv2
import numpy as np
import pytest

from vgps.landmarks.descriptors import describe


def texture(rng: np.random.Generator) -> np.ndarray:
    blocks = rng.integers(0, 256, (30, 40), dtype=np.uint8)
    return cv2.GaussianBlur(cv2.resize(blocks, (320, 240), interpolation=cv2.INTER_NEAREST), (0, 0), 1.0)


@pytest.mark.slow
def test_a_shifted_and_turned_image_has_the_same_features_elsewhere() -> None:
    image = texture(np.random.default_rng(0))
    move = cv2.getRotationMatrix2D((160, 120), 20, 1.0)
    move[:, 2] += (6, -4)
    uv, one = describe(image, 1500)
    uv_moved, other = describe(cv2.warpAffine(image, move, (320, 240)), 1500)
    assert one.shape == (len(uv), 32) and one.dtype == np.uint8
    bits = np.unpackbits(one[:, None] ^ other[None], axis=2).sum(axis=2)
    nearest = bits.argmin(axis=1)
    sure = bits.min(axis=1) < 20
    error = np.linalg.norm(uv @ move[:, :2].T + move[:, 2] - uv_moved[nearest], axis=1)
    assert sure.sum() > 50
    assert np.mean(error[sure] < 4) > 0.9


def test_no_more_features_than_asked_for_and_none_on_grey() -> None:
    image = texture(np.random.default_rng(1))
    assert len(describe(image, 40)[0]) <= 40 < len(describe(image, 1500)[0])
    uv, descriptors = describe(np.full((120, 160), 90, np.uint8), 1500)
    assert uv.shape == (0, 2) and descriptors.shape == (0, 32)
