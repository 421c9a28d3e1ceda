import numpy as np
import pytest

from vgps.geometry.path_smoothing import smoothed


def test_a_frame_that_juts_out_is_spread_over_five():
    path = np.zeros((9, 2))
    path[4, 1] = 16.0
    assert smoothed(path)[:, 1].tolist() == [0.0, 0.0, 1.0, 4.0, 6.0, 4.0, 1.0, 0.0, 0.0]
    assert not smoothed(path)[:, 0].any()


def test_steady_motion_stays_and_beyond_the_ends_the_path_stands():
    path = np.arange(9.0)[:, None]
    np.testing.assert_allclose(smoothed(path)[2:-2], path[2:-2])
    assert smoothed(path)[0, 0] == pytest.approx((1.0 * 4.0 + 2.0 * 1.0) / 16.0)


def test_a_quarter_is_left_of_a_motion_of_four_frames():
    path = np.cos(np.arange(12.0) * np.pi / 2.0)[:, None]
    np.testing.assert_allclose(smoothed(path)[2:-2], 0.25 * path[2:-2], atol=1e-12)
