from dataclasses import replace

import numpy as np
from synthetic_fixes import fixes_of_size

from vgps.config import GpsConfig
from vgps.gps.fixes import CLASSES
from vgps.gps.offset_errors import averaged_over_receivers, mean_errors, step_scale
from vgps.model import FixClass

KINDS = [FixClass.RTK_FLOAT, FixClass.RTK_FIX, FixClass.SINGLE, FixClass.RTK_FLOAT]


def test_each_fix_has_the_mean_errors_of_its_class():
    config, count = GpsConfig(), len(KINDS)
    fixes = fixes_of_size(np.arange(count) * 1.0, np.zeros((count, 3)), np.ones(count), np.ones(count))
    fixes = replace(fixes, fix_class=np.array([CLASSES.index(kind) for kind in KINDS]))
    found, since_s = mean_errors(fixes, config), np.array([0.0, 1.0, 2.0, 7.0])
    each = [averaged_over_receivers(config.offset_errors(kind)) for kind in KINDS]
    for name in ("noise_m", "walk_m", "rate_lasts_s", "tail", "vertical"):
        np.testing.assert_array_equal(getattr(found, name), [getattr(one, name) for one in each])
    steps = [step_scale(one, dt) for one, dt in zip(each, since_s, strict=True)]
    np.testing.assert_allclose(step_scale(found, since_s), steps, rtol=1e-14)


def test_there_may_be_no_fixes():
    nothing = fixes_of_size(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
    assert mean_errors(nothing, GpsConfig()).noise_m.shape == (0,)
