"""Pictures that are made as bright as each other."""

import numpy as np
import pytest

from vgps.tracking.brightness import equally_bright


@pytest.fixture
def picture():
    return np.random.default_rng(3).uniform(20.0, 220.0, (60, 80)).astype(np.uint8)


@pytest.mark.parametrize("order", [1, -1])
def test_the_darker_one_is_stretched(picture, order):
    dark = (0.25 * picture + 10.0).astype(np.uint8)
    bright, stretched = equally_bright(*(picture, dark)[::order])[::order]
    assert bright is picture
    # a gray value of the dark one is four of the bright one
    assert np.abs(stretched.astype(int) - picture).max() <= 6


def test_an_offset_alone_is_taken_away(picture):
    hazy, clear = equally_bright(picture // 2 + 120, picture // 2)
    assert np.abs(hazy.astype(int) - clear).max() <= 1


def test_what_nearly_agrees_stays(picture):
    nearly = (0.9 * picture).astype(np.uint8)
    first, second = equally_bright(picture, nearly)
    assert first is picture and second is nearly


def test_a_gray_value_more_in_the_dark_is_no_other_exposure(picture):
    dark, brighter = picture // 20, picture // 20 + 1
    first, second = equally_bright(dark, brighter)
    assert first is dark and second is brighter


@pytest.mark.parametrize("value", [0, 255])
def test_a_picture_that_shows_nothing_stays(picture, value):
    nothing = np.full_like(picture, value)
    first, second = equally_bright(picture, nothing)
    assert first is picture and second is nothing
