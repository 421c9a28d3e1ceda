import numpy as np

from vgps.mapping.bending import continued


def test_bending_goes_on_after_stage_c_for_as_long_as_the_next_one_takes():
    bending = np.full(100, np.nan)
    bending[5:10], bending[10:40] = 9.0, np.arange(30.0)
    found = continued(bending)
    np.testing.assert_array_equal(found[:5], 0.0)
    np.testing.assert_array_equal(found[5:40], bending[5:40])
    np.testing.assert_allclose(found[40:70], 14.5)
    np.testing.assert_array_equal(found[70:], 0.0)
    np.testing.assert_array_equal(continued(np.full(4, np.nan)), np.zeros(4))
