"""The rate of a receiver's clock: found where a path turns early and late, and never made up."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import fixes_at, trajectory

from vgps.config import SensorsConfig
from vgps.gps.clock_rate import search_clock_rate
from vgps.solution import GpsClock

VIDEO_S = np.arange(0.0, 120.0, 0.1)
CONFIG = SensorsConfig()
STILL = np.zeros(3)


def streets(t_s):
    """Positions (N, 3) of a car that turns, brakes and drives on, again and again."""
    fine = np.arange(-20.0, 140.0, 0.02)
    speed = 9.0 - 5.0 * np.exp(-(((fine % 30.0 - 15.0) / 3.0) ** 2))
    heading = 0.8 * np.sin(fine / 4.0) + 0.6 * np.sin(fine / 9.0)
    moved = 0.02 * np.cumsum(speed * np.exp(1j * heading))
    return np.stack([np.interp(t_s, fine, moved.real), np.interp(t_s, fine, moved.imag), 0 * t_s], axis=1)


def straight(t_s):
    return np.stack([7.0 * t_s, 2.0 * t_s, 0 * t_s], axis=1)


def stamped(place_of, clock, noise_m=0.02, seed=0):
    """Fixes of a receiver with such a clock."""
    t_s = np.arange(0.5, 119.0)
    noise = np.random.default_rng(seed).normal(0.0, noise_m, (len(t_s), 3))
    fixes = replace(fixes_at(t_s, 2.4, 6.5), world_p_fix=place_of(t_s) + noise)
    return replace(fixes, t_s=clock.time_stamps(t_s))


def search(place_of, clock, config=CONFIG, **given):
    path = trajectory(place_of(VIDEO_S), VIDEO_S)
    return search_clock_rate(path, stamped(place_of, clock, **given), STILL, config)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("clock", "seed"),
    [
        (GpsClock(0.0, 0.001), 0),
        (GpsClock(0.3, 0.01), 1),
        (GpsClock(-1.2, 0.034), 0),
        (GpsClock(0.2, -0.02), 1),
    ],
)
def test_a_rate_is_found_with_its_standard_deviation(clock, seed):
    found = search(streets, clock, seed=seed)
    assert found is not None and found.is_significant
    assert abs(found.clock.rate - clock.rate) < 4.0 * found.rate_sigma < 0.001
    middle_s = VIDEO_S.mean()
    late_s = found.clock.on_video(middle_s) - clock.on_video(middle_s)
    assert abs(late_s) < 4.0 * found.time_offset_sigma_s < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("noise_m", [0.02, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_clocks_of_one_rate_stay_as_they_are(noise_m, seed):
    assert search(streets, GpsClock(0.2), noise_m=noise_m, seed=seed) is None


@pytest.mark.slow
def test_a_straight_shows_no_rate():
    assert search(straight, GpsClock(0.0, 0.01)) is None


@pytest.mark.slow
def test_a_rate_that_is_not_significant_counts_where_it_is_asked_for():
    path, fixes = trajectory(streets(VIDEO_S), VIDEO_S), stamped(streets, GpsClock(0.0, 0.0003), noise_m=0.3)
    assert search_clock_rate(path, fixes, STILL, CONFIG) is None
    found = search_clock_rate(path, fixes, STILL, CONFIG, anyway=True)
    assert not found.is_significant and abs(found.clock.rate - 0.0003) < 4.0 * found.rate_sigma


def test_a_few_fixes_show_nothing():
    path = trajectory(streets(VIDEO_S), VIDEO_S)
    few = stamped(streets, GpsClock(0.0, 0.01)).where(np.arange(50, 55))
    assert search_clock_rate(path, few, STILL, CONFIG, anyway=True) is None
