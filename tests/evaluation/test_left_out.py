"""What was left out of the pictures, in words."""

import numpy as np
from solutions import PINHOLE, make_solution

from vgps.evaluation.left_out import left_out_sentences


def run(static=(), moving=()):
    """Ten frames of 640 x 480 with these regions."""
    poses = np.tile(np.eye(4), (10, 1, 1))
    given = {"static_regions": static, "moving_regions": moving}
    rows = {name: np.array(regions, dtype=np.int64).reshape(-1, 6) for name, regions in given.items()}
    return make_solution(np.arange(10) / 10, poses, camera=PINHOLE, **rows)


HALF, QUARTER = (2, 5, 0, 240, 640, 480), (5, 9, 0, 0, 320, 240)


def test_share_and_frames_are_stated():
    made = run(static=(HALF, QUARTER))
    expected = [0, 0, 0.5, 0.5, 0.5, 0.75, 0.25, 0.25, 0.25, 0.25]
    np.testing.assert_allclose(made.static_share, expected, atol=1e-12)
    assert not made.moving_share.any()
    (sentence,) = left_out_sentences(made)
    assert "left out: up to 75.0 % of it, in 8 of 10 frames" in sentence


def test_what_moves_on_its_own_has_a_sentence_beside_it():
    made = run(static=[HALF], moving=[QUARTER])
    static, moving = left_out_sentences(made)
    assert "up to 50.0 % of it, in 4 of 10 frames" in static
    assert "moves on its own" in moving and "cover up to 25.0 % of it, in 5 of 10 frames" in moving
    np.testing.assert_array_equal(made.left_out, [HALF, QUARTER])


def test_nothing_left_out_needs_no_sentence():
    assert left_out_sentences(run()) == []
