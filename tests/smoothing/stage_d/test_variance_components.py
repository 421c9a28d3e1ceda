"""The video's weight follows the misfit of the fixes, as far as their errors are independent."""

import numpy as np
import pytest
from synthetic_fixes import fixes_of_size

from vgps.config import Config
from vgps.gps.antenna_path import antenna_offsets
from vgps.gps.fix_errors import region_sigmas
from vgps.gps.fixes import Fixes, independent_epochs
from vgps.smoothing.stage_d.variance_components import balanced_sigma_scale, variance_factor
from vgps.solution import Trajectory

T_S = np.arange(0.0, 100.0, 0.5)
STANDING = Trajectory(T_S, np.tile(np.eye(4), (len(T_S), 1, 1)))


def fixes(misfit, correlation_s=1.0, n=50):
    """One a second, each off by ``misfit`` sigmas along every axis."""
    at = np.zeros((n, 3))
    found = fixes_of_size(np.arange(n, dtype=float), at, np.full(n, 2.4), np.full(n, 6.5))
    at += misfit * region_sigmas(found)
    found.correlation_s[:] = correlation_s
    return found


def scale(misfit, correlation_s=1.0, **batch):
    config = Config()
    settings = {"balance": "estimated", "balance_prior_fixes": 4.0, "balance_range": 8.0, **batch}
    config = config.model_copy(update={"batch": config.batch.model_copy(update=settings)})
    return balanced_sigma_scale(config, 8.0, STANDING, fixes(misfit, correlation_s), np.zeros(3))


def test_fixes_that_fit_as_expected_change_nothing():
    assert scale(1.0) == pytest.approx(8.0)


def test_a_misfit_of_two_sigmas_doubles_the_scale_up_to_the_prior():
    assert scale(2.0) == pytest.approx(8.0 * np.sqrt((4 + 50 * 4) / 54))
    assert scale(0.5) == pytest.approx(8.0 * np.sqrt((4 + 50 / 4) / 54))


def test_correlated_errors_count_as_few():
    # the first, and 49 each worth a hundredth
    assert scale(2.0, correlation_s=100.0) == pytest.approx(8.0 * np.sqrt((4 + 1.49 * 4) / 5.49))
    np.testing.assert_allclose(independent_epochs(fixes(0.0, 4.0, n=3)), [1.0, 0.25, 0.25])


def test_the_scale_is_bounded_and_can_be_fixed():
    assert scale(1e6) == 64.0
    assert scale(2.0, balance="fixed") == 8.0


def test_without_fixes_the_scale_is_unchanged():
    config = Config()
    config = config.model_copy(update={"batch": config.batch.model_copy(update={"balance": "estimated"})})
    assert balanced_sigma_scale(config, 8.0, STANDING, Fixes.empty(), np.zeros(3)) == 8.0


def test_the_variance_factor_is_one_where_fixes_fit_and_where_there_are_none():
    def factor(found):
        offset = antenna_offsets(found, STANDING, np.zeros(3))
        return variance_factor(Config().batch, offset, found, independent_epochs(found))

    assert factor(fixes(1.0)) == pytest.approx(1.0) and factor(Fixes.empty()) == 1.0
    assert factor(fixes(3.0)) == pytest.approx((4 + 50 * 9) / 54)
