"""Which times fixes have, by how smoothly they move over them."""

import numpy as np
import pytest

from vgps.readers.gps_formats.uneven_times import fix_times

SEEDS = range(20)
for_each_log = pytest.mark.parametrize(
    ("count", "interval_s", "off_s"), [(40, 1.0, 0.1), (100, 0.2, 0.02), (200, 0.1, 0.02)]
)


def drive(t_s):
    """Places (n, 2) of a car that turns and brakes, at 3 to 13 m/s."""
    t_s = np.asarray(t_s)
    return np.stack([8.0 * t_s + 15.0 * np.sin(0.33 * t_s), 20.0 * np.cos(0.21 * t_s)], axis=1)


def stamps(seed, count, interval_s, off_s):
    """Even times of which some are missing, and time stamps that are uniformly off them."""
    rng = np.random.default_rng(seed)
    even_s = 5.0 + interval_s * np.sort(rng.choice(int(1.2 * count), count, replace=False))
    return even_s, even_s + rng.uniform(-off_s, off_s, count), 0.01 * rng.normal(size=(count, 2))


@for_each_log
def test_stamps_that_places_contradict_become_even(count, interval_s, off_s):
    for seed in SEEDS:
        even_s, given_s, noise_m = stamps(seed, count, interval_s, off_s)
        found = fix_times(given_s, drive(even_s) + noise_m)
        late_s = found.t_s - even_s
        assert found.sigma_s == 0.0 and "have the even times" in found.notes[0]
        assert np.ptp(late_s) < 0.5 * off_s and abs(late_s.mean()) < 0.5 * off_s


@for_each_log
def test_uneven_times_at_which_places_are_right_stay(count, interval_s, off_s):
    for seed in SEEDS:
        _, given_s, noise_m = stamps(seed, count, interval_s, off_s)
        found = fix_times(given_s, drive(given_s) + noise_m)
        assert found.t_s is given_s and not found.notes and found.sigma_s == 0.0


def test_a_few_fixes_that_tell_nothing_may_be_off_by_as_much_as_their_stamps():
    _, given_s, _ = stamps(0, 9, 1.0, 0.02)
    found = fix_times(given_s, drive(given_s) + 0.1 * np.random.default_rng(0).normal(size=(9, 2)))
    assert found.t_s is given_s and 0.005 < found.sigma_s < 0.02
    assert f"{found.sigma_s:.3f} s off even times" in found.notes[0]


@pytest.mark.parametrize(
    ("t_s", "speed"),
    [
        (np.arange(50.0), 1.0),  # a receiver's own times
        (np.arange(50.0) + 0.0005 * (-1.0) ** np.arange(50), 1.0),  # with their last digit
        (np.arange(50.0) + 0.1 * (-1.0) ** np.arange(50), 1e-4),  # stands
        (np.cumsum(np.random.default_rng(0).uniform(0.2, 1.8, 50)), 1.0),  # pictures taken by hand
        (np.arange(5.0) + 0.1 * (-1.0) ** np.arange(5), 1.0),  # too few
        (np.array([0.0]), 1.0),
        (np.zeros(0), 1.0),
    ],
)
def test_other_times_stay(t_s, speed):
    found = fix_times(t_s, speed * drive(np.arange(len(t_s))))
    assert found.t_s is t_s and not found.notes and found.sigma_s == 0.0
