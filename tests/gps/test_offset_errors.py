from dataclasses import replace

import numpy as np
from synthetic_fixes import fixes_of_size

from vgps.config import GpsConfig
from vgps.gps.fixes import CLASSES
from vgps.gps.offset_errors import (
    averaged_over_receivers,
    log_walk_density,
    mean_errors,
    step_scale,
    student,
    walk_scale,
)
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


def test_the_errors_of_the_last_digits_add_to_noise_along_each_axis():
    errors, added_m = GpsConfig().offset_errors(FixClass.RTK_FIX), np.array([0.3, 0.0, 0.4])
    noise_m, vertical_m = np.hypot(0.2, 0.3), np.hypot(0.2 * errors.vertical, 0.4)
    share = np.sqrt(errors.tail / (errors.tail + 3.0))
    found = student(errors, 0.2, added_m).sigma_m
    np.testing.assert_allclose(found, share * np.array([noise_m, 0.2, vertical_m]))


def test_a_step_between_two_fixes_holds_the_errors_of_the_last_digits_of_both():
    """Student's t in space with 3 degrees of freedom: gamma(3) / gamma(3/2) / (3 pi)^(3/2) at its centre."""
    config, added_m = GpsConfig(), np.array([[0.3, 0.0, 0.0], [0.4, 0.0, 0.0]])
    fixes = fixes_of_size(np.arange(2.0), np.zeros((2, 3)), np.ones(2), np.ones(2), logging_sigma_m=added_m)
    fixes = replace(fixes, fix_class=np.full(2, CLASSES.index(FixClass.RTK_FIX)))
    errors = config.offset_errors(FixClass.RTK_FIX)
    plane_m = np.hypot(walk_scale(errors, np.ones(1)), np.sqrt(2.0) * errors.noise_m)
    scales = np.hypot(plane_m, 0.5) * plane_m * errors.vertical * plane_m
    peak = 2.0 / (np.sqrt(np.pi) / 2.0) / (3.0 * np.pi) ** 1.5
    found = log_walk_density(np.zeros((1, 3)), fixes, config)
    np.testing.assert_allclose(found, np.log(peak / scales))
