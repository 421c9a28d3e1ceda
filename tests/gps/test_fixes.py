"""The table of fixes."""

import numpy as np
from solutions import make_gps_log

from vgps.config import Config
from vgps.gps.fixes import fixes_in_world
from vgps.model import FixClass


def test_fixes_are_of_an_rtk_receiver_if_any_is_of_such_a_class():
    log = make_gps_log(np.arange(3.0), (FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.SINGLE))
    some = fixes_in_world(log, np.zeros((3, 3)), Config().gps)
    assert some.are_rtk and some.where(np.array([1])).are_rtk
    assert not some.where(np.array([2])).are_rtk and not some.where(np.zeros(0, int)).are_rtk
