"""Whether halves of the features agree, by directions that are drawn, and which of two models fits better."""

import numpy as np
import pytest

from vgps.tracking.start_significance import fits_better, shows_motion

PIXELS = np.random.default_rng(0).uniform(0, 300, (60, 2))


def drawn(rng, count=1):
    """A function of features that gives directions that have nothing to do with them."""

    def directions(first, last):
        vectors = rng.normal(size=(count, 3))
        return vectors / np.linalg.norm(vectors, axis=1)[:, None]

    return directions


@pytest.mark.slow
def test_directions_by_chance_are_seldom_significant():
    """The bound holds, for one direction of each half and for three."""
    for count in (1, 3):
        rng = np.random.default_rng(count)
        shown = [shows_motion(PIXELS, PIXELS, drawn(rng, count), 0.1) for _ in range(300)]
        assert np.mean(shown) <= 0.1


def test_halves_that_show_one_direction_are_significant():
    """Within 2 degrees of each other: a quantile of a third of (1 - cos 2 deg) / 2 is at most 0.0009."""
    rng = np.random.default_rng(0)

    def directions(first, last):
        vector = np.array([*rng.uniform(-0.0122, 0.0122, 2), 1.0])
        return vector[None] / np.linalg.norm(vector)

    assert shows_motion(PIXELS, PIXELS, directions, 0.0009)
    assert not shows_motion(PIXELS, PIXELS, directions, 1e-8)


def test_one_motion_of_a_plane_in_common_is_enough():
    """Halves take either of two motions, so that only some of the splits agree."""
    rng = np.random.default_rng(0)
    assert shows_motion(PIXELS, PIXELS, lambda first, last: np.eye(3)[[rng.integers(2)]], 1e-9)


def test_halves_that_show_nothing_are_no_evidence():
    assert not shows_motion(PIXELS, PIXELS, lambda first, last: np.zeros((0, 3)), 0.99)


def test_a_third_of_the_splits_suffices_and_no_more_are_drawn():
    for agreeing, drawn_splits, shown in (((0, 1, 2), 3, True), ((6, 7, 8), 9, True), ((7, 8), 7, False)):
        splits = []

        def directions(first, last, splits=splits, agreeing=agreeing):
            splits.append(first)
            number, other_half = divmod(len(splits) - 1, 2)
            return np.eye(3)[[0 if number in agreeing else other_half]]

        assert shows_motion(PIXELS, PIXELS, directions, 0.01) == shown
        assert len(splits) == 2 * drawn_splits


def test_halves_share_no_feature_and_every_feature_is_in_one():
    seen = []
    shows_motion(PIXELS, PIXELS, lambda first, last: seen.append(first) or np.eye(3)[:1], 0.01)
    for one, other in zip(seen[::2], seen[1::2], strict=True):
        together = np.concatenate([one, other])
        np.testing.assert_array_equal(np.sort(together, axis=0), np.sort(PIXELS, axis=0))


def test_a_model_fits_better_if_most_features_say_so():
    """100 gains of mean 0.2 and scatter 0.5 are 4 sigmas, of mean 0.1 two."""
    scatter = np.tile((-0.5, 0.5), 50)
    assert fits_better(np.zeros(100), 0.2 + scatter)
    assert not fits_better(np.zeros(100), 0.1 + scatter)
    assert not fits_better(0.2 + scatter, np.zeros(100))
