from pathlib import Path

import numpy as np
import pytest

from vgps.model import FixClass, GpsLog


@pytest.mark.parametrize("rows", [[2, 0], [True, False, True]])
def test_rows_of_a_log_keep_what_belongs_together(rows):
    columns = [np.arange(3.0) + 10 * k for k in range(4)]
    more = [np.arange(3.0) + 10 * k for k in range(4, 7)]
    kinds = (FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.SINGLE)
    sigma = np.arange(9.0).reshape(3, 3)
    log = GpsLog(*columns, kinds, sigma, *more, np.array([5, 6, 7]), Path("log"), ("a note",))
    some = log.rows(np.array(rows))
    taken = np.arange(3)[rows]
    assert len(some) == 2 and some.source == log.source and some.skipped == log.skipped
    assert some.line.tolist() == (5 + taken).tolist()
    assert some.t_s.tolist() == taken.tolist() and some.hdop.tolist() == (40 + taken).tolist()
    assert some.fix_class == tuple(kinds[row] for row in taken)
    np.testing.assert_array_equal(some.sigma_m, sigma[taken])
