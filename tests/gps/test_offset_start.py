"""Tests of the initial values of the fixes' offsets."""

import numpy as np
import pytest

from factors import Gaussian
from vgps.gps.offset_start import smoothed_offsets

NOISE = Gaussian((0.1, 0.1, 0.2))
STEP = Gaussian((0.1, 0.1, 0.2))


def test_one_offset_is_the_mean_of_its_fixes():
    error = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]])
    assert smoothed_offsets(error, np.array([0, 0]), [NOISE, NOISE], {}) == pytest.approx(
        np.array([[2.0, 2.0, 2.0]])
    )


def test_noise_and_a_step_of_the_same_size_share_a_difference():
    error = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, -0.6]])  # minimises a^2 + (d - b)^2 + (b - a)^2
    offsets = smoothed_offsets(error, np.array([0, 1]), [NOISE, NOISE], {1: STEP})
    assert offsets == pytest.approx(np.array([[0.1, 0.0, -0.2], [0.2, 0.0, -0.4]]))


def test_offsets_that_start_anew_keep_their_fixes():
    error = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.6, 0.0, 0.0]])
    offsets = smoothed_offsets(error, np.arange(3), [NOISE] * 3, {2: STEP})
    assert offsets[:, 0] == pytest.approx([0.0, 0.4, 0.5])


def test_a_fix_far_off_moves_its_neighbours_by_less_than_a_step():
    heavy = Gaussian((0.1, 0.1, 0.1), 2.0)
    error = np.zeros((9, 3))
    error[4] = 5.0
    offsets = smoothed_offsets(error, np.arange(9), [heavy] * 9, dict.fromkeys(range(1, 9), STEP))
    assert np.abs(offsets).max() < 0.1


def test_a_jump_of_all_that_follow_is_kept_as_a_jump():
    heavy = Gaussian((0.1, 0.1, 0.1), 2.0)
    error = np.repeat([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]], 5, axis=0)
    offsets = smoothed_offsets(error, np.arange(10), [NOISE] * 10, dict.fromkeys(range(1, 10), heavy))
    assert offsets[:, 0] == pytest.approx(error[:, 0], abs=0.1)
