"""Noise and walk of fixes are found from their displacements against those of the path."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import fixes_of_size, path, trajectory

from vgps.config import Config
from vgps.gps.fixes import CLASSES
from vgps.gps.learned_errors import (
    LearnedErrors,
    _of_a_placed_path,
    largest_errors,
    learn_errors,
    with_errors,
)
from vgps.gps.offset_errors import one_sigma, step_scale
from vgps.gps.regions import INSIDE_PLANE
from vgps.model import FixClass

CONFIG = Config()
FLOAT, DGPS = FixClass.RTK_FLOAT, FixClass.DGPS
FRAMES_S = 0.1 * np.arange(1200)
TRUE_PATH = trajectory(path(FRAMES_S), FRAMES_S)


def log(walk_m, noise_m, fix_class=DGPS, interval_s=1.0, seed=0, duration_s=115.0):
    """Fixes 5 m off, whose errors walk by the class's Student's t, with noise of the same kind."""
    rng, t_s = np.random.default_rng(seed), np.arange(0.05, duration_s, interval_s)
    tail = CONFIG.gps.offset_errors(fix_class).tail
    # the sum of n steps of finite variance is n^(1/2) as long
    steps = walk_m * np.sqrt(interval_s) * rng.standard_t(tail, (len(t_s), 3))
    error = 5.0 + np.cumsum(steps, axis=0) + noise_m * rng.standard_t(tail, (len(t_s), 3))
    return fixes_with(t_s, path(t_s) + error, fix_class)


def fixes_with(t_s, world_p_fix, fix_class):
    region = CONFIG.gps.regions[fix_class]
    return fixes_of_size(
        t_s,
        world_p_fix,
        np.full(len(t_s), region.r_m),
        np.full(len(t_s), region.h_m),
        correlation_s=np.full(len(t_s), region.correlation_s),
        fix_class=np.full(len(t_s), CLASSES.index(fix_class)),
    )


def learned(fixes, camera_path=TRUE_PATH, config=CONFIG, torn=()):
    torn = np.isin(np.arange(len(camera_path) - 1), torn)
    return learn_errors(fixes, camera_path, torn, np.zeros(3), config)


def test_a_path_that_is_torn_is_no_noise_of_fixes():
    """RTK-fixes on a path that jumps at each of its tears."""
    rng, t_s = np.random.default_rng(0), np.arange(0.05, 115.0)
    fixes = fixes_with(t_s, path(t_s) + 0.005 * rng.standard_normal((len(t_s), 3)), FixClass.RTK_FIX)
    tears = np.arange(29, 1199, 30)  # every three seconds
    jumps = np.cumsum(np.isin(np.arange(1200), tears + 1)[:, None] * rng.normal(0.0, 2.0, (1200, 3)), axis=0)
    poses = TRUE_PATH.world_T_camera.copy()
    poses[:, :3, 3] += jumps
    torn = replace(TRUE_PATH, world_T_camera=poses)
    assert learned(fixes, torn)[FixClass.RTK_FIX].noise_m > 0.1
    assert not learned(fixes, torn, torn=tears)


@pytest.mark.slow
@pytest.mark.parametrize("walk_m", [0.03, 0.1, 0.4])
def test_the_walk_of_a_receiver_is_found(walk_m):
    found = [learned(log(walk_m, 0.005, seed=seed))[DGPS].walk_m for seed in range(5)]
    # the smallest could in part be errors of the video, 1.5 cm over the 5 m between two fixes
    assert 0.6 < np.median(found) / walk_m < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("noise_m", [0.03, 0.15])
def test_the_noise_of_frequent_fixes_is_found_beside_their_walk(noise_m):
    found = [learned(log(0.05, noise_m, interval_s=0.2, seed=seed))[DGPS] for seed in range(5)]
    # the prior expects a rate that lasts, by which part of a walk at random looks like noise
    assert 0.75 < np.median([one.noise_m for one in found]) / noise_m < 1.4
    # behind much noise a walk may be larger than it is
    assert 0.8 < np.median([one.walk_m for one in found]) / 0.05 < 2.5


@pytest.mark.slow
def test_errors_that_a_receiver_smooths_within_a_second_are_no_smaller_for_it():
    def found(interval_s, seed):
        rng, t_s = np.random.default_rng(seed), np.arange(0.05, 20.0, interval_s)
        rate = 0.1 * rng.standard_t(3.0, (20, 3))  # m/s, another one every second
        error = np.stack([np.interp(t_s, np.arange(21), np.append(0, np.cumsum(r))) for r in rate.T], axis=1)
        return learned(fixes_with(t_s, path(t_s) + error, DGPS))[DGPS].walk_m

    # as a walk at random, steps of 0.1 s would say 0.03 m in a second
    assert 0.06 < np.median([found(0.1, seed) for seed in range(5)]) < 0.15


@pytest.mark.slow
def test_errors_that_keep_their_rate_are_told_from_a_walk_at_random():
    def found(lasts_s, seed):
        """Errors of 0.1 m in a second, whose rate lasts: how far they may lead in a minute, over the true
        root mean square, and how long the rate is said to last."""
        rng, t_s = np.random.default_rng(seed), np.arange(0.05, 115.0)
        changes_s = np.arange(0.0, 130.0, lasts_s)
        steps = 0.1 * lasts_s * rng.standard_normal((len(changes_s), 3))
        error = np.stack([np.interp(t_s, changes_s, axis) for axis in np.cumsum(steps, axis=0).T], axis=1)
        one = learned(fixes_with(t_s, path(t_s) + error, DGPS))[DGPS]
        errors = CONFIG.gps.offset_errors(DGPS).model_copy(update=vars(one))
        far_m = one_sigma(errors) * float(step_scale(errors, 60.0))
        return far_m / (0.1 * lasts_s * np.sqrt(60.0 / lasts_s)), one.rate_lasts_s

    ratios, lasts_s = np.median([[found(s, seed) for s in (1.0, 8.0)] for seed in range(5)], axis=0).T
    assert (ratios > 0.7).all() and (ratios < 2.0).all()
    assert lasts_s[0] < 3.0 and lasts_s[1] > 6.0


def test_errors_below_those_of_the_video_are_only_known_to_be_small():
    sway = 0.05 * np.sin(FRAMES_S / 0.9)[:, None]
    found = learned(log(1e-4, 1e-4, FLOAT), trajectory(path(FRAMES_S) + sway, FRAMES_S))[FLOAT]
    assert found.walk_m < 0.05


def turned(share):
    """The true path, longer by a share and turned by as many radians."""
    wrong = path(FRAMES_S) * (1.0 + share)
    wrong[:, :2] = wrong[:, :2] @ [[np.cos(share), np.sin(share)], [-np.sin(share), np.cos(share)]]
    return trajectory(wrong, FRAMES_S)


def test_a_scale_and_heading_as_wrong_as_a_first_solution_leaves_them_are_no_walk():
    exact, found = (learned(log(0.05, 0.005), p)[DGPS] for p in (TRUE_PATH, turned(0.003)))
    assert found.walk_m == pytest.approx(exact.walk_m, rel=0.05)


def test_an_error_that_drifts_steadily_along_a_straight_is_a_walk():
    t_s = np.arange(0.05, 60.0)
    straight = np.stack([9.0 * FRAMES_S, 0.0 * FRAMES_S, 0.0 * FRAMES_S], axis=1)
    drift = np.stack([0.0 * t_s, 0.3 * t_s, 0.0 * t_s], axis=1)  # as if the heading were wrong by two degrees
    seen = np.stack([9.0 * t_s, 0.0 * t_s, 0.0 * t_s], axis=1)
    found = learned(fixes_with(t_s, seen + drift, FLOAT), trajectory(straight, FRAMES_S))[FLOAT]
    assert found.walk_m > 0.1


def test_scale_and_heading_are_as_free_as_the_places_of_the_fixes_leave_them():
    """So an error that drifts steadily between RTK-fixes far apart is a walk, not the heading."""

    def freedom(apart_m, fix_class):
        t_s = np.array([0.0, 1000.0])  # two independent errors
        placing = fixes_with(t_s, np.array([[0.0, 0.0, 0.0], [apart_m, 0.0, 0.0]]), fix_class)
        return _of_a_placed_path(CONFIG, placing).sensors.time_offset.factor_sigma

    share = CONFIG.gps.memory.path_share
    assert freedom(500.0, FixClass.RTK_FIX) == pytest.approx(share, rel=0.01)
    sigma_m = CONFIG.gps.regions[FLOAT].r_m / INSIDE_PLANE
    shown = sigma_m / np.sqrt(50.0**2 + 50.0**2)  # either is 50 m from their middle
    assert freedom(100.0, FLOAT) == pytest.approx(np.hypot(share, shown))
    assert freedom(1.0, FLOAT) == freedom(0.0, FLOAT) == CONFIG.sensors.time_offset.factor_sigma


def test_few_fixes_and_rtk_fixes_keep_the_constants_of_their_class():
    assert learned(log(0.1, 0.01, duration_s=4.0)) == {}
    assert learned(log(0.005, 0.005, FixClass.RTK_FIX)) == {}


def test_nothing_is_learned_of_independent_errors_or_if_the_settings_say_so():
    independent = CONFIG.gps.model_copy(update={"error_model": "independent"})
    kept = CONFIG.gps.model_copy(update={"memory": CONFIG.gps.memory.model_copy(update={"learn": False})})
    for gps in (independent, kept):
        config = CONFIG.model_copy(update={"gps": gps})
        assert learned(log(0.1, 0.01), config=config) == {} == largest_errors(gps)


def test_the_largest_errors_are_three_spreads_above_the_class():
    errors = CONFIG.gps.memory.classes[FLOAT]
    largest = largest_errors(CONFIG.gps)[FLOAT]
    assert largest.walk_m == pytest.approx(errors.walk_m * np.exp(3 * errors.walk_spread))
    assert largest.noise_m == pytest.approx(errors.noise_m * np.exp(3 * errors.noise_spread))
    assert FixClass.RTK_FIX not in largest_errors(CONFIG.gps)


def test_learned_errors_replace_those_of_their_class_alone():
    gps = with_errors(CONFIG.gps, {FLOAT: LearnedErrors(0.2, 0.3, 4.0)})
    found = gps.offset_errors(FLOAT)
    assert (found.noise_m, found.walk_m, found.tail) == (0.2, 0.3, CONFIG.gps.offset_errors(FLOAT).tail)
    assert gps.offset_errors(DGPS) == CONFIG.gps.offset_errors(DGPS)


@pytest.mark.parametrize(("noise_m", "interval_s"), [(0.06, 0.1), (0.06, 0.25), (0.15, 0.1)])
def test_the_noise_of_rtk_fixes_is_found_where_no_receiver_has_so_much(noise_m, interval_s):
    t_s = np.arange(0.05, 115.0, interval_s)
    error = noise_m * np.random.default_rng(0).normal(size=(len(t_s), 3))
    found = learned(fixes_with(t_s, path(t_s) + error, FixClass.RTK_FIX))[FixClass.RTK_FIX]
    assert found.noise_m == pytest.approx(noise_m, rel=0.1)
    assert found.walk_m == CONFIG.gps.offset_errors(FixClass.RTK_FIX).walk_m


@pytest.mark.parametrize("interval_s", [0.1, 1.0])
def test_usual_rtk_fixes_keep_the_errors_of_their_class(interval_s):
    t_s = np.arange(0.05, 115.0, interval_s)
    error = 0.015 * np.random.default_rng(0).normal(size=(len(t_s), 3))
    assert learned(fixes_with(t_s, path(t_s) + error, FixClass.RTK_FIX)) == {}


def test_the_errors_of_the_last_digits_are_not_learned_again():
    exact = log(0.01, 0.02)
    coarse = replace(exact, world_p_fix=np.round(exact.world_p_fix, 0))
    known = replace(coarse, logging_sigma_m=np.full((len(exact), 3), 12.0**-0.5))
    assert learned(known)[DGPS].noise_m < 0.5 * learned(coarse)[DGPS].noise_m
