"""Pairs of views of a shifting texture: their pixels differ by the shift, and a still image gives none."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from vgps.config import CameraCalibrationConfig, TrackingConfig
from vgps.model import Frame
from vgps.tracking.view_pairs import view_pairs

SIZE, STEP_PX = (320, 240), 5


@pytest.fixture(scope="module")
def texture():
    noise = gaussian_filter(np.random.default_rng(0).normal(size=(240, 500)), 1.5)
    return np.uint8(np.clip(127 + 400 * noise, 0, 255))


def found(texture, steps, **settings):
    frames = [
        Frame(k, 0.1 * k, np.ascontiguousarray(texture[:, place : place + 320]))
        for k, place in enumerate(steps)
    ]
    config = CameraCalibrationConfig(**settings)
    return view_pairs(frames, SIZE, TrackingConfig(), config, np.random.default_rng(0))


def test_a_pair_ends_once_the_image_has_moved_far_enough(texture):
    pairs = found(texture, range(0, 60, STEP_PX))
    # 3 % of the diagonal of 400 px are 12 px, passed after three frames
    assert pairs.count == 3 and pairs.pair.max() == 2
    shift = pairs.first_px - pairs.second_px
    np.testing.assert_allclose(np.median(shift, axis=0), [3 * STEP_PX, 0.0], atol=0.1)


def test_no_more_pairs_than_wanted(texture):
    assert found(texture, range(0, 150, STEP_PX), max_pairs=4).count == 4


def test_a_camera_that_stands_gives_no_pair(texture):
    pairs = found(texture, [0] * 10)
    assert pairs.count == 0 and pairs.first_px.shape == (0, 2)


def test_thinned_pairs_keep_features_of_each(texture):
    pairs = found(texture, range(0, 60, STEP_PX))
    few = pairs.thinned(20)
    before, after = (np.bincount(each.pair) for each in (pairs, few))
    assert few.count == pairs.count and np.all(after < before)
    assert np.all((after >= 20) & (after < 40))
    np.testing.assert_array_equal(few.first_px[0], pairs.first_px[0])
    np.testing.assert_array_equal(pairs.thinned(10_000).second_px, pairs.second_px)
