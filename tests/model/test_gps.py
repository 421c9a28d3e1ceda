import numpy as np
import pytest
from solutions import make_gps_log

from vgps.model import FixClass


@pytest.mark.parametrize("rows", [[2, 0], [True, False, True]])
def test_rows_of_a_log_keep_what_belongs_together(rows):
    kinds = (FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.SINGLE)
    sigma = np.arange(9.0).reshape(3, 3)
    numbers = ("latitude_deg", "longitude_deg", "height_m", "hdop", "satellites", "correction_age_s", "line")
    columns = {name: np.arange(3.0) + 10 * (k + 1) for k, name in enumerate(numbers)}
    log = make_gps_log(np.arange(3.0), kinds, sigma_m=sigma, skipped=("a note",), **columns)
    some = log.rows(np.array(rows))
    taken = np.arange(3)[rows]
    assert len(some) == 2 and some.source == log.source and some.skipped == log.skipped
    assert some.line.tolist() == (70 + taken).tolist()
    assert some.t_s.tolist() == taken.tolist() and some.hdop.tolist() == (40 + taken).tolist()
    assert some.fix_class == tuple(kinds[row] for row in taken)
    np.testing.assert_array_equal(some.sigma_m, sigma[taken])
