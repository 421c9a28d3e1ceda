from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import fixes_at, trajectory

from vgps.config import SensorsConfig
from vgps.gps.video_speed import refined_video_speed, search_video_speed, usual_video_speed

NONE = np.zeros(3)
SETTINGS = SensorsConfig()


def wandering(seed, until_s):
    """Return times and places of a vehicle that turns and changes its speed by chance."""
    t_s = np.arange(0.0, until_s, 0.1)
    rng, turn, faster = np.random.default_rng(seed), np.zeros(len(t_s)), np.zeros(len(t_s))
    for k in range(1, len(t_s)):
        turn[k] = turn[k - 1] * (1.0 - 0.1 / 3.0) + 0.04 * rng.normal()
        faster[k] = faster[k - 1] * (1.0 - 0.1 / 8.0) + 0.2 * rng.normal()
    step_m = 0.1 * np.maximum(3.0 + faster, 0.0) * np.exp(1j * np.cumsum(turn) * 0.1)
    place = np.cumsum(step_m)
    return t_s, np.column_stack([place.real, place.imag, np.zeros(len(t_s))])


def log_of(motion, seed, wander_m=0.0):
    """Return a fix a second of a motion, with 2 cm of noise and errors that walk by so much in a second."""
    t_s, place = motion
    fix_s, rng = np.arange(0.2, t_s[-1], 1.0), np.random.default_rng(seed)
    error = rng.normal(0.0, 0.02, (len(fix_s), 3)) + np.cumsum(rng.normal(0.0, wander_m, (len(fix_s), 3)), 0)
    seen = np.column_stack([np.interp(fix_s, t_s, axis) for axis in place.T])
    return replace(fixes_at(fix_s, 0.05 + 10.0 * wander_m, 0.1), world_p_fix=seen + error)


def played(motion, speed, seconds, first_s=0.0):
    """Return the path of a video of the first seconds of a motion, in a frame of its own, that drifts."""
    t_s, place = (axis[: round(10 * seconds)] for axis in motion)
    drift = np.cumsum(np.random.default_rng(9).normal(0.0, 0.01, place.shape), axis=0)
    turned = (place + drift)[:, [1, 0, 2]] * [0.3, -0.3, 0.3]
    return trajectory(turned, first_s + t_s / speed)


def found(motion, log, speed, seconds, first_s=0.0):
    log = replace(log, t_s=log.t_s + first_s)
    shown = search_video_speed(played(motion, speed, seconds, first_s), first_s, log, NONE, SETTINGS)
    return shown.speed if shown is not None and shown.is_certain else None


@pytest.mark.parametrize("speed", [0.25, 3.0, 15.0])
@pytest.mark.parametrize(("wander_m", "seed", "first_s"), [(0.0, 0, 0.0), (0.15, 1, 7.0)])
def test_a_video_that_plays_at_another_speed_has_the_shape_of_the_log(speed, wander_m, seed, first_s):
    motion = wandering(seed, 50.0)
    speed_found = found(motion, log_of(motion, seed, wander_m), speed, 40.0, first_s)
    assert speed_found == pytest.approx(speed, rel=0.015)


@pytest.mark.parametrize(("speed", "late_s"), [(3.0, 20.0), (0.5, -8.0)])
def test_a_speed_is_found_though_the_clocks_are_far_apart(speed, late_s):
    motion = wandering(1, 90.0)
    log = log_of(motion, 1)
    later = replace(log, t_s=log.t_s + late_s)
    shown = search_video_speed(played(motion, speed, 40.0), 0.0, later, NONE, SETTINGS)
    assert shown is not None and shown.is_certain and shown.speed == pytest.approx(speed, rel=0.015)
    assert shown.time_offset_s == pytest.approx(late_s, abs=0.3)


def test_clocks_that_are_far_apart_are_no_speed():
    motion = wandering(1, 90.0)
    log = log_of(motion, 1)
    later = replace(log, t_s=log.t_s + 20.0)
    assert search_video_speed(played(motion, 1.0, 40.0), 0.0, later, NONE, SETTINGS) is None


@pytest.mark.slow
def test_minutes_that_last_seconds_are_found_though_half_a_percent_is_a_turn():
    motion = wandering(4, 310.0)
    assert found(motion, log_of(motion, 4), 15.0, 300.0) == pytest.approx(15.0, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("seconds", [4.0, 12.0, 40.0])
def test_a_video_that_plays_as_time_passes_keeps_its_times(seed, seconds):
    motion = wandering(seed, 60.0)
    assert found(motion, log_of(motion, seed, 0.1 * (seed % 2)), 1.0, seconds) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_log_of_another_drive_has_no_speed(seed):
    assert found(wandering(seed, 40.0), log_of(wandering(seed + 100, 90.0), seed), 1.0, 40.0) is None


def test_a_straight_at_constant_speed_shows_none():
    t_s = np.arange(0.0, 60.0, 0.1)
    straight = t_s, np.column_stack([5.0 * t_s, np.zeros_like(t_s), np.zeros_like(t_s)])
    path, log = played(straight, 4.0, 40.0), log_of(straight, 0)
    assert search_video_speed(path, 0.0, log, NONE, SETTINGS) is None


def test_a_short_drive_by_coarse_fixes_leaves_a_speed_in_doubt():
    motion = wandering(3, 16.0)
    shown = search_video_speed(played(motion, 5.0, 16.0), 0.0, log_of(motion, 3, 0.2), NONE, SETTINGS)
    assert shown is not None and not shown.is_certain
    assert shown.speed == pytest.approx(5.0, rel=0.1)


def test_without_fixes_or_motion_there_is_none():
    motion = wandering(0, 40.0)
    log = log_of(motion, 0)
    assert found(motion, log.where(np.arange(0)), 3.0, 40.0) is None
    assert found(motion, log, 3.0, 0.1) is None  # one frame
    assert found((motion[0], np.zeros_like(motion[1])), log, 3.0, 40.0) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_speed_that_is_almost_right_is_refined_and_its_sigma_holds(seed):
    motion = wandering(seed, 50.0)
    speed, sigma = refined_video_speed(played(motion, 0.98, 40.0), 0.0, log_of(motion, seed), NONE, SETTINGS)
    assert abs(np.log(speed / 0.98)) < 3.0 * sigma and sigma < 0.01


@pytest.mark.parametrize(
    ("speed", "sigma", "usual"),
    [
        (1.994, 0.003, 2.0),
        (0.2493, 0.002, 0.25),
        (15.02, 0.001, 15.0),
        (3.3, 0.003, None),
        (1.994, 0.0005, None),  # four standard deviations away
        (60.0, 0.003, None),  # as likely by chance
    ],
)
def test_a_speed_that_may_be_a_whole_number_is_one(speed, sigma, usual):
    assert usual_video_speed(speed, sigma) == usual
