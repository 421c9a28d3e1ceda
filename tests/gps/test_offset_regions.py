"""The size of an offset follows from its class and from what is stated, over receivers that differ."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import fixes_of_size

from vgps.config import GpsConfig, Region
from vgps.gps.fixes import CLASSES
from vgps.gps.offset_regions import offset_bounds, with_mean_offset_regions, with_offset_regions
from vgps.model import FixClass

CONFIG = GpsConfig()
SURVEYED = CONFIG.model_copy(
    update={"regions": {**CONFIG.regions, FixClass.RTK_FLOAT: Region(r_m=0.4, h_m=0.9)}}
)
MEMORY, ERRORS = CONFIG.memory, CONFIG.memory.classes[FixClass.RTK_FLOAT]
PLANE = float(np.sqrt(-2.0 * np.log(0.05)))


def one_float(sigma_m=np.nan, r_m=2.4, h_m=6.5):
    kind = np.array([CLASSES.index(FixClass.RTK_FLOAT)])
    sizes = np.array([r_m]), np.array([h_m])
    return fixes_of_size(
        np.array([1.0]), np.zeros((1, 3)), *sizes, fix_class=kind, sigma_m=np.full((1, 3), sigma_m)
    )


def test_the_region_is_that_of_the_class_over_receivers():
    median = with_offset_regions(one_float(), CONFIG)
    assert (median.r_m, median.h_m) == (pytest.approx(ERRORS.r_m), pytest.approx(ERRORS.h_m))


def test_stated_sigmas_are_weighed_by_how_sure_they_are():
    share = ERRORS.between_receivers**2 / (ERRORS.between_receivers**2 + MEMORY.stated_spread**2)
    (r_m,) = with_offset_regions(one_float(sigma_m=0.02), CONFIG).r_m
    stated = MEMORY.stated_factor * 0.02 * PLANE
    assert np.log(r_m) == pytest.approx((1 - share) * np.log(ERRORS.r_m) + share * np.log(stated))
    assert stated < r_m < ERRORS.r_m


def test_the_mean_region_is_the_root_mean_square_over_receivers_that_state_the_same():
    """Receivers are drawn by both log-normal laws; those that state about 0.3 m are looked at."""
    rng = np.random.default_rng(0)
    size_m = ERRORS.r_m / PLANE * np.exp(ERRORS.between_receivers * rng.standard_normal(2_000_000))
    stated_m = size_m / MEMORY.stated_factor * np.exp(MEMORY.stated_spread * rng.standard_normal(len(size_m)))
    alike = np.abs(np.log(stated_m / 0.3)) < 0.05
    mean = with_mean_offset_regions(one_float(sigma_m=0.3), CONFIG)
    assert mean.r_m[0] / PLANE == pytest.approx(np.sqrt(np.mean(size_m[alike] ** 2)), rel=0.05)
    unstated = with_mean_offset_regions(one_float(), CONFIG)
    assert unstated.r_m[0] / PLANE == pytest.approx(np.sqrt(np.mean(size_m**2)), rel=0.03)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_of_a_known_size_a_region_holds_95_percent_of_what_its_bound_allows(n):
    given = one_float(r_m=0.4, h_m=0.9)
    mean, (bound, tail) = with_mean_offset_regions(given, SURVEYED), offset_bounds(given, SURVEYED, n)
    at = np.linspace(0.0, 5.0, 200_001)  # metres
    plane = at * np.exp(-0.5 * (at / bound.r_m) ** (2 * n))  # the density of a radius, and of a height
    line = np.exp(-0.5 * (at / bound.h_m) ** (2 * n))
    assert plane[at < mean.r_m].sum() / plane.sum() == pytest.approx(0.95, abs=1e-3)
    assert line[at < mean.h_m].sum() / line.sum() == pytest.approx(0.95, abs=1e-3)
    assert np.isinf(tail)


def test_a_bound_is_a_mixture_of_sizes_that_differ_as_the_receivers_do():
    """Student's t is a Gaussian whose variance has an inverse chi-squared distribution."""
    (bound, (tail,)) = offset_bounds(one_float(), CONFIG, 1)
    chi_squared = np.random.default_rng(0).chisquare(tail, 1_000_000)
    size_m = np.log(bound.r_m * np.sqrt(tail / chi_squared))
    assert size_m.mean() == pytest.approx(np.log(ERRORS.r_m / PLANE), abs=0.005)
    assert size_m.std() == pytest.approx(ERRORS.between_receivers, abs=0.005)


def test_what_a_receiver_states_makes_the_tails_lighter():
    (_, stated), (_, unstated) = (offset_bounds(one_float(sigma_m), CONFIG, 1) for sigma_m in (0.3, np.nan))
    assert 1.0 < unstated[0] < stated[0] < 2.0


def test_a_region_that_was_set_bounds_the_offset_and_is_believed_more():
    config, given = SURVEYED, one_float(r_m=0.4, h_m=0.9)
    median, mean = with_offset_regions(given, config), with_mean_offset_regions(given, config)
    assert (median.r_m, median.h_m) == (pytest.approx(0.4), pytest.approx(0.9))
    assert mean.h_m == pytest.approx(0.9 * np.exp(MEMORY.own_spread**2))
    doubled = replace(given, r_m=2.0 * given.r_m)  # as a bad dilution of precision does
    assert with_offset_regions(doubled, config).r_m == pytest.approx(0.8)
    assert config.offset_errors(FixClass.RTK_FLOAT).r_m == 0.4
    assert config.offset_errors(FixClass.RTK_FLOAT).walk_m == ERRORS.walk_m
