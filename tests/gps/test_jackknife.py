"""Standard deviations by leaving out parts."""

import numpy as np
import pytest
from synthetic_fixes import fixes_at

from vgps.gps.jackknife import jackknife_sigma, without_blocks


def test_of_a_mean_it_is_the_standard_error():
    values = np.array([1.0, 2.0, 4.0, 7.0])
    without_one = [np.delete(values, k).mean() for k in range(4)]
    assert jackknife_sigma(without_one) == pytest.approx(values.std(ddof=1) / 2.0)


@pytest.mark.parametrize(("number", "parts"), [(1, 4), (6, 6), (50, 10)])
def test_every_fix_is_left_out_once_and_a_part_is_without_a_gap(number, parts):
    fixes = fixes_at(np.arange(0.05, 19.0), 2.4, 6.5)
    some = without_blocks(fixes, number)
    left_out = [np.flatnonzero(~np.isin(fixes.t_s, one.t_s)) for one in some]
    assert len(some) == parts
    np.testing.assert_array_equal(np.concatenate(left_out), np.arange(len(fixes)))
    assert all(np.all(np.diff(rows) == 1) and len(rows) <= len(fixes) / parts + 1 for rows in left_out)
