"""Covariance of fixes: an offset that a stretch shares, its walk and the noise."""

import numpy as np
import pytest
from synthetic_fixes import fixes_of_size

from vgps.config import GpsConfig
from vgps.gps.error_covariance import error_covariances
from vgps.gps.fixes import CLASSES
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FixClass

CONFIG = GpsConfig()


def fixes_of_classes(*names, interval_s=1.0, **columns):
    """A fix a second of each class, with the class's region."""
    regions = [CONFIG.regions[name] for name in names]
    t_s = interval_s * np.arange(len(names))
    return fixes_of_size(
        t_s,
        np.zeros((len(names), 3)),
        np.array([region.r_m for region in regions]),
        np.array([region.h_m for region in regions]),
        fix_class=np.array([CLASSES.index(name) for name in names]),
        **columns,
    )


def test_a_stretch_shares_its_offset_and_stretches_do_not():
    classes = [FixClass.RTK_FIX] * 3 + [FixClass.SINGLE] * 3
    east, north, up = error_covariances(fixes_of_classes(*classes), CONFIG)
    np.testing.assert_array_equal(east, north)
    assert not east[:3, 3:].any() and not up[:3, 3:].any()
    single = CONFIG.offset_errors(FixClass.SINGLE)
    assert east[3, 4] == pytest.approx((single.r_m / INSIDE_PLANE) ** 2, rel=0.02)
    assert up[3, 4] == pytest.approx((single.h_m / INSIDE_LINE) ** 2, rel=0.02)
    for axis in (east, up):
        assert np.linalg.eigvalsh(axis).min() > 0.0


def test_the_difference_of_two_fixes_has_the_variance_of_walk_and_noise():
    """Student's t with 3 degrees of freedom has its 84 % quantile at 1.197; receivers differ by e^0.7 in
    noise and by e^0.6 in walk."""
    errors = CONFIG.offset_errors(FixClass.RTK_FIX)
    east, _, up = error_covariances(fixes_of_classes(*[FixClass.RTK_FIX] * 2), CONFIG)
    noise_m, walk_m = np.exp(0.7**2 / 2) * errors.noise_m, np.exp(0.6**2 / 2) * errors.walk_m
    expected = 1.197**2 * (walk_m**2 + 2 * noise_m**2)
    assert east[0, 0] + east[1, 1] - 2 * east[0, 1] == pytest.approx(expected, rel=0.01)
    assert up[0, 0] + up[1, 1] - 2 * up[0, 1] == pytest.approx(errors.vertical**2 * expected, rel=0.01)


def test_long_after_the_offset_is_another():
    config = GpsConfig(memory={"max_gap_s": 1e9})
    far = error_covariances(fixes_of_classes(*[FixClass.SINGLE] * 2, interval_s=1e6), config)[0]
    assert far[0, 1] < 1e-6 * far[0, 0]


def test_the_errors_of_the_last_digits_are_those_of_each_fix():
    classes, logging_sigma_m = [FixClass.RTK_FIX] * 2, np.array([[0.3, 0.0, 0.0], [0.0, 0.0, 0.5]])
    found = error_covariances(fixes_of_classes(*classes, logging_sigma_m=logging_sigma_m), CONFIG)
    added = found - error_covariances(fixes_of_classes(*classes), CONFIG)
    expected = np.zeros((3, 2, 2))
    expected[0, 0, 0], expected[2, 1, 1] = 0.3**2, 0.5**2
    np.testing.assert_allclose(added, expected, atol=1e-12)
