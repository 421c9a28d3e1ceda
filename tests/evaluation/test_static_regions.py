"""What never moves in the picture, in words."""

import numpy as np
from solutions import PINHOLE, make_solution

from vgps.evaluation.static_regions import static_sentence


def run(*regions: tuple[int, ...]):
    """Ten frames of 640 x 480 with these regions."""
    made = make_solution(np.arange(10) / 10, np.tile(np.eye(4), (10, 1, 1)), camera=PINHOLE)
    rows = np.array(regions, dtype=np.int64).reshape(-1, 6)
    return made if not regions else make_solution(made.t_s, made.world_T_camera, static_regions=rows)


def test_share_and_frames_are_stated():
    half, quarter = (2, 5, 0, 240, 640, 480), (5, 9, 0, 0, 320, 240)
    share = run(half, quarter).static_share
    np.testing.assert_allclose(share, [0, 0, 0.5, 0.5, 0.5, 0.75, 0.25, 0.25, 0.25, 0.25], atol=1e-12)
    sentence = static_sentence(run(half, quarter))
    assert sentence is not None
    assert "up to 75.0 % of it was left out, in 8 of 10 frames" in sentence


def test_nothing_static_needs_no_sentence():
    assert static_sentence(run()) is None
