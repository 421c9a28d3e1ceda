"""The benchmark of the video alone: the scale along a path."""

import numpy as np

from scripts.benchmarks.odometry import scales


def test_the_scale_is_that_of_pieces_of_ten_metres():
    """Half of a straight drive of 100 m has 0.8 of the scale of the rest; an overall scale says nothing."""
    true = np.column_stack([np.arange(0.0, 101.0), np.zeros(101), np.zeros(101)])
    step = np.where(np.arange(100) < 40, 0.8, 1.0)
    centres = true.copy()
    centres[1:, 0] = 3.0 * np.cumsum(step)
    found = scales(centres, true)
    assert len(found) == 9
    np.testing.assert_allclose(found, np.where(np.arange(9) < 4, 0.8, 1.0), rtol=1e-9)
