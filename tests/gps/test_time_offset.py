from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_values import plain
from synthetic_fixes import T_S, fixes_at, path, trajectory

from vgps.config import Config, GpsConfig, SensorsConfig, TimeOffsetConfig
from vgps.gps.antenna_path import place
from vgps.gps.fixes import Fixes
from vgps.gps.knots import Knots
from vgps.gps.neighbour_pairs import neighbour_pairs
from vgps.gps.sensors import Sensors, TimeOffset
from vgps.gps.time_offset import (
    best_time_offset,
    estimate_time_offset,
    likelier_time_offset,
    min_gain,
    model_average,
    update_time_offset,
    with_agreed_clock,
)

BELIEVED = TimeOffset(0.0, 0.5)
NONE = np.zeros(3)
SENSORS = Sensors.fixed(NONE)


def by_differences(camera_path, fixes, antenna, prior):
    return best_time_offset(neighbour_pairs(camera_path, fixes, antenna, prior, TimeOffsetConfig()), prior)


def late(time_offset_s, offset=0.0, t_s=np.arange(0.05, 19.0)):  # noqa: B008
    """Return fixes whose time stamps are later than their positions."""
    fixes = fixes_at(t_s, 2.4, 6.5, offset=offset)
    return replace(fixes, t_s=t_s + time_offset_s)


def fixes_that_lie(t_s, world_p_fix, r_m=2.4, h_m=6.5):
    return replace(fixes_at(t_s, r_m, h_m), world_p_fix=world_p_fix)


def no_offset_is_found(camera_path, fixes):
    """Return whether the time offset is unchanged; the only warning allowed is that it is not determined."""
    sensors, remarks = update_time_offset(SENSORS, camera_path, fixes, SensorsConfig())
    held = (SENSORS.time_offset_s, SENSORS.prior_time_offset)
    assert all("does not determine" in remark for remark in remarks)
    return (sensors.time_offset_s, sensors.prior_time_offset) == held


def wander(seed, n=19):
    """Return errors of metres that change by centimetres per second."""
    steps = np.random.default_rng(seed).normal(0, 0.08, (n, 3))
    return np.array([1.5, -1.0, 4.0]) + np.cumsum(steps, axis=0)


@pytest.mark.parametrize("time_offset_s", [-0.8, -0.1, 0.0, 0.37, 1.2])
def test_a_time_offset_is_estimated_under_a_drifting_bias(time_offset_s):
    found = by_differences(trajectory(path(T_S)), late(time_offset_s, wander(0)), NONE, BELIEVED)
    assert abs(found.time_offset_s - time_offset_s) < 4 * found.sigma_s and found.sigma_s < 0.1


def test_time_offsets_of_a_grid_are_compared_as_each_by_itself():
    fixes = late(0.3, wander(0))
    pairs = neighbour_pairs(trajectory(path(T_S)), fixes, NONE, BELIEVED, TimeOffsetConfig())
    grid = np.array([-0.4, 0.0, 0.3])
    alone = [pairs.difference(float(one)) for one in grid]
    np.testing.assert_allclose(pairs.difference(grid), alone, rtol=1e-9)


def test_factors_absorb_as_many_residuals_as_they_are_free_to():
    """Two factors of 19 s, complex numbers, are four parameters; two of them are common to both."""

    def absorbed(factor_sigma, common_factor_sigma):
        config = TimeOffsetConfig(factor_sigma=factor_sigma, common_factor_sigma=common_factor_sigma)
        return neighbour_pairs(trajectory(path(T_S)), late(0.0, wander(0)), NONE, BELIEVED, config).absorbed()

    assert absorbed(0.9, 0.0) == pytest.approx(4.0, abs=0.01)
    assert absorbed(1e-6, 0.0) == pytest.approx(0.0, abs=0.01)
    assert absorbed(1e-6, 0.9) == pytest.approx(2.0, abs=0.01)
    assert 0.1 < absorbed(0.01, 0.0) < 3.9 and 2.1 < absorbed(0.01, 0.9) < 3.9


@pytest.mark.slow
def test_the_sigma_is_the_scatter_over_many_logs():
    logs = [late(0.2, wander(seed)) for seed in range(60)]
    found = [by_differences(trajectory(path(T_S)), log, NONE, BELIEVED) for log in logs]
    scatter = np.std([one.time_offset_s for one in found])
    assert 0.6 < scatter / np.mean([one.sigma_s for one in found]) < 1.6


def test_one_jump_of_the_receiver_has_little_effect():
    offset = wander(1)
    offset[9:] += [6.0, 4.0, 0.0]
    found = by_differences(trajectory(path(T_S)), late(0.37, offset), NONE, BELIEVED)
    assert abs(found.time_offset_s - 0.37) < 0.1


def with_jitter(motion, seed, late_s=0.0, until_s=28.0):
    """Return a path of frames and ten fixes a second of a motion t_s -> (n, 3), both with 4 mm of noise."""
    frame_s, fix_s = np.arange(0.0, until_s + 2.0, 0.1), np.arange(1.0, until_s, 0.1)
    rng = np.random.default_rng(seed)
    seen = trajectory(motion(frame_s) + rng.normal(0.0, 0.004, (len(frame_s), 3)), frame_s)
    places = motion(fix_s - late_s) + rng.normal(0.0, 0.004, (len(fix_s), 3))
    return seen, fixes_that_lie(fix_s, places, 0.02, 0.04)


@pytest.mark.parametrize("seed", range(6))
def test_jitter_of_a_path_around_a_circle_is_no_time_offset(seed):
    """Between two frames there is less of it, which says nothing of the clocks."""

    def circle(t_s):
        return 15.0 * np.column_stack([np.sin(t_s / 10.0), 1.0 - np.cos(t_s / 10.0), np.zeros_like(t_s)])

    assert no_offset_is_found(*with_jitter(circle, seed))


def turns_and_braking(t_s):
    along = 8.0 * t_s - 15.0 * np.cos(t_s / 5.0)
    return np.column_stack([along, 20.0 * np.sin(along / 40.0), np.zeros_like(t_s)])


@pytest.mark.parametrize("seed", range(3))
def test_jitter_does_not_hide_a_time_offset_that_turns_and_braking_show(seed):
    log = with_jitter(turns_and_braking, seed, late_s=0.3)
    sensors, _ = update_time_offset(SENSORS, *log, SensorsConfig())
    assert sensors.time_offset_s == pytest.approx(0.3, abs=0.015)


def once_around(t_s):
    """Return a walk of half a minute once around a house, at a speed that changes by a tenth."""
    angle = 0.2 * t_s + 0.05 * np.sin(0.9 * t_s)
    return 8.0 * np.column_stack([np.cos(angle), np.sin(angle), np.zeros_like(t_s)])


def laid_on(camera, fixes):
    """Return a path in the place, at the heading and the scale that suit the fixes best."""
    seen = camera.world_T_camera[:, :2, 3] @ [1.0, 1.0j]
    wanted = fixes.world_p_fix[:, :2] @ [1.0, 1.0j]
    columns = np.column_stack([np.interp(fixes.t_s, camera.t_s, seen), np.ones(len(fixes))])
    (factor, origin), *_ = np.linalg.lstsq(columns, wanted, rcond=None)
    placed = seen * factor + origin
    return trajectory(np.column_stack([placed.real, placed.imag, np.zeros(len(placed))]), camera.t_s)


@pytest.mark.parametrize("late_s", [-0.6, 0.6])
def test_a_walk_in_a_circle_that_was_laid_on_fixes_of_another_clock_does_not_hide_it(late_s):
    """The path is turned by what a clock of the camera would turn it by, and the rest tells the clock."""
    camera, fixes = with_jitter(once_around, 0, late_s)
    second = fixes.where(np.arange(len(fixes)) % 10 == 0)
    found = by_differences(laid_on(camera, second), second, NONE, BELIEVED)
    assert found.sigma_s < 0.05 and abs(found.time_offset_s - late_s) < 3.0 * found.sigma_s


def around(t_s):
    """Return a walk in a circle at constant speed, where a time offset is another heading."""
    return 8.0 * np.column_stack([np.cos(0.2 * t_s), np.sin(0.2 * t_s), np.zeros_like(t_s)])


def bent(camera, scale, heading):
    """Return a path whose steps have other scales and headings (F,), as a video's drift."""
    seen = camera.world_T_camera[:, :2, 3] @ [1.0, 1.0j]
    steps = np.diff(seen) * np.exp(scale + 1.0j * heading)[1:]
    moved = np.concatenate([seen[:1], seen[0] + np.cumsum(steps)])
    return trajectory(np.column_stack([moved.real, moved.imag, np.zeros(len(moved))]), camera.t_s)


@pytest.mark.slow
def test_the_drift_of_a_video_around_a_circle_is_no_time_offset():
    """By the scatter from pair to pair alone two of these are -1.5 and 1.9 s, at 15 standard deviations."""
    rng = np.random.default_rng(0)
    for seed in range(40):
        camera, fixes = with_jitter(around, seed, late_s=0.6)
        scale, heading = 0.03 * np.sin(2.0 * np.pi * (camera.t_s / 25.0 + rng.random((2, 1))))
        second = fixes.where(np.arange(len(fixes)) % 10 == 0)
        assert no_offset_is_found(laid_on(bent(camera, scale, heading), second), second)


@pytest.mark.slow
def test_seven_seconds_show_a_time_offset_by_fixes_closer_than_a_second():
    logs = [with_jitter(turns_and_braking, seed, late_s=0.3, until_s=8.0) for seed in range(10)]
    found = [update_time_offset(SENSORS, *log, SensorsConfig())[0].time_offset_s for log in logs]
    shown = [time_offset_s for time_offset_s in found if time_offset_s]
    assert len(shown) > 3 and shown == pytest.approx([0.3] * len(shown), abs=0.1)


@pytest.mark.parametrize("estimate", ["auto", "yes"])
def test_a_straight_at_constant_speed_keeps_the_prior_with_a_warning(estimate):
    t_s = np.arange(0.05, 19.0)
    line = np.stack([0 * T_S, 5 * T_S, 0 * T_S], axis=1)
    fixes = replace(fixes_that_lie(t_s, np.stack([0 * t_s, 5 * t_s, 0 * t_s], axis=1)), t_s=t_s + 0.37)
    settings = SensorsConfig(estimate_time_offset=estimate)
    sensors, remark = update_time_offset(SENSORS, trajectory(line), fixes, settings)
    assert sensors.time_offset_s == 0.0 and "does not determine the time offset" in remark[0]


def test_without_fixes_there_is_no_warning():
    assert update_time_offset(SENSORS, trajectory(path(T_S)), Fixes.empty(), SensorsConfig())[1] == ()


def test_one_fix_leaves_the_time_offset_alone():
    one = late(0.37, t_s=np.array([5.0]))
    with np.errstate(invalid="raise"):
        assert no_offset_is_found(trajectory(path(T_S)), one)


def test_auto_estimates_only_a_significant_time_offset():
    for time_offset_s, kept in ((0.37, True), (0.03, False)):
        sensors, remark = update_time_offset(
            SENSORS, trajectory(path(T_S)), late(time_offset_s, wander(2)), SensorsConfig()
        )
        assert bool(sensors.time_offset_s) == bool(remark) == kept
    off = SensorsConfig(estimate_time_offset="no")
    assert update_time_offset(SENSORS, trajectory(path(T_S)), late(0.37), off) == (SENSORS, ())


def test_too_few_fixes_leave_the_prior():
    found = by_differences(trajectory(path(T_S)), late(0.37, t_s=np.array([5.0, 6.0])), NONE, BELIEVED)
    assert found == BELIEVED


@pytest.mark.parametrize("seed", range(40))
def test_braking_alone_gives_no_spurious_time_offset_at_the_frame_rate(seed):
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 6.0, 0.1)
    line = np.stack([0 * t_s, 9.0 * t_s - 0.75 * t_s**2, 0 * t_s], axis=1)
    fixes = fixes_that_lie(t_s, line + rng.normal(0.0, 0.05, line.shape), 0.12, 0.1)
    drifted = line + np.cumsum(rng.normal(0.0, 0.01, line.shape), axis=0)
    assert no_offset_is_found(trajectory(drifted, t_s), fixes)


@pytest.mark.parametrize("share", [0.03j, 0.02 + 0.02j, -0.03])
def test_wrong_scale_and_heading_give_no_time_offset_while_accelerating_in_a_bend(share):
    t_s = np.arange(0.05, 19.0)

    def place(t):
        turn = 0.02 * t
        speed = (4.0 + 0.5 * t) * np.exp(1j * turn)
        return np.cumsum(speed) * (t[1] - t[0])

    fine = np.arange(0.0, 20.0, 0.01)
    way = place(fine)
    seen = np.interp(t_s, fine, way)
    fixes = fixes_that_lie(t_s, np.stack([seen.real, seen.imag, 0 * t_s], axis=1), 0.07, 0.05)
    wrong = np.interp(T_S, fine, way) * (1.0 + share)
    line = np.stack([wrong.real, wrong.imag, 0 * T_S], axis=1)
    assert no_offset_is_found(trajectory(line), fixes)


def test_few_pairs_or_many_values_require_a_larger_gain():
    assert abs(min_gain(3.0, 10**6, 1.0) - 9.0) < 0.01
    assert abs(min_gain(3.0, 9, 1.0) - 4.094**2) < 0.05  # tables of Student's t, 0.27 % on both sides
    assert min_gain(3.0, 5, 30.0) > min_gain(3.0, 50, 30.0) > min_gain(3.0, 50, 1.0)
    assert min_gain(3.0, 0, 1.0) == np.inf


@pytest.mark.slow
def test_a_few_fixes_give_no_spurious_time_offset():
    """Ten seconds of a walk round a corner with a float's wandering error."""
    t_s, fixes_s = np.arange(0.0, 10.0, 0.1), np.linspace(0.5, 9.5, 8)

    def place(t):
        return np.stack([np.minimum(t, 5.0), np.maximum(t - 5.0, 0.0), 0 * t], axis=1) * 1.2

    for seed in range(100):
        offset = np.cumsum(np.random.default_rng(seed).normal(0, 0.05, (len(fixes_s), 3)), axis=0)
        fixes = fixes_that_lie(fixes_s, place(fixes_s) + offset)
        assert no_offset_is_found(trajectory(place(t_s), t_s), fixes)


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 12), st.lists(st.floats(-5.0, 30.0), min_size=1, max_size=20))
def test_weights_of_knots_are_those_of_linear_interpolation(knots, at_s):
    knots_s, rng = np.linspace(1.0, 22.5, knots), np.random.default_rng(0)
    weights = np.stack([np.interp(at_s, knots_s, row) for row in np.eye(knots)], axis=1)
    interpolation = Knots(place(knots_s, np.array(at_s)), knots)
    factor, values = (rng.normal(size=(n, 2)) @ (1, 1j) for n in (knots, len(at_s)))
    np.testing.assert_allclose(interpolation.interpolated(factor), weights @ factor, atol=1e-12)
    np.testing.assert_allclose(interpolation.sums(values), weights.T @ values, atol=1e-12)
    normal = weights.T @ np.diag(np.abs(values)) @ weights
    band = interpolation.normal_band(np.abs(values))
    np.testing.assert_allclose(band[1], np.diag(normal), atol=1e-12)
    np.testing.assert_allclose(band[0, 1:], np.diag(normal, 1), atol=1e-12)


def test_hypotheses_are_weighed_by_their_evidence():
    likely, probability = model_average(TimeOffset(0.104, 0.1), TimeOffset(0.0, 0.5), 0.1)
    variance = np.array([0.02, 0.26])  # of 0.104 under either hypothesis
    evidence = np.exp(-0.5 * 0.104**2 / variance) / np.sqrt(variance)
    assert probability == pytest.approx(evidence[1] / evidence.sum())
    assert likely.time_offset_s == pytest.approx((1 - probability) * 0.052 + probability * 0.1)
    within = (1 - probability) * 0.005 + probability * 0.25 * 0.01 / 0.26
    between = probability * (1 - probability) * (0.1 - 0.052) ** 2
    assert likely.sigma_s == pytest.approx(np.sqrt(within + between))


def likelier(fixes):
    return likelier_time_offset(SENSORS, trajectory(path(T_S)), fixes, SensorsConfig())


def test_fixes_that_say_nothing_leave_the_time_offset_alone():
    assert likelier(Fixes.empty()) == (SENSORS, ())
    assert likelier(late(0.4, wander(0)).where(np.arange(4))) == (SENSORS, ())


def test_a_camera_that_stands_says_nothing_either():
    standing = trajectory(np.zeros((len(T_S), 3)))
    walking = fixes_that_lie(np.arange(0.05, 19.0), wander(0))
    assert likelier_time_offset(SENSORS, standing, walking, SensorsConfig()) == (SENSORS, ())


@pytest.mark.slow
@pytest.mark.parametrize("count", [8, 19])
def test_no_time_offset_is_invented(count):
    logs = [late(0.0, wander(seed)).where(np.arange(count)) for seed in range(60)]
    assert sum(bool(likelier(log)[1]) for log in logs) <= 3


@pytest.mark.slow
def test_a_probable_time_offset_is_used_with_an_honest_sigma():
    results = [likelier(late(0.25, wander(seed))) for seed in range(60)]
    shifted = [sensors for sensors, warnings in results if warnings]
    assert len(shifted) > 30
    errors = [(one.time_offset_s - 0.25) / one.prior_time_offset.sigma_s for one in shifted]
    assert np.sqrt(np.mean(np.square(errors))) < 2.0


def test_what_may_be_chance_has_to_be_shown_again_where_fixes_err_by_less():
    fixes = late(0.25, wander(1))
    coarse, warnings = likelier(fixes)
    assert warnings and coarse.probability == 1.0
    one_is_good = np.where(np.arange(19) == 3, 0.07, fixes.r_m)
    shown, warnings = likelier(replace(fixes, r_m=one_is_good))
    assert not warnings and 0.5 <= shown.probability < 1.0
    assert plain(shown) == plain(replace(coarse, probability=shown.probability))


def estimated(fixes):
    settings = SensorsConfig(estimate_time_offset="yes")
    return update_time_offset(SENSORS, trajectory(path(T_S)), fixes, settings)


@pytest.mark.parametrize("estimate", [estimated, likelier])
def test_fixes_within_a_second_count_once(estimate):
    t_s = np.arange(0.05, 19.0, 0.1)
    fast = late(0.4, np.repeat(wander(3), 10, axis=0)[: len(t_s)], t_s)  # the same error ten times a second
    slow = fast.where(np.arange(0, len(t_s), 10))
    sigma_s = [estimate(fixes)[0].prior_time_offset.sigma_s for fixes in (fast, slow)]
    assert 0.5 < sigma_s[0] / sigma_s[1] < 2.0  # a jackknife scatters; ten times as many would give 0.3


def test_fixes_of_a_second_count_though_their_stamps_are_not_quite_even():
    even_s = np.arange(0.05, 19.0)
    uneven_s = even_s + np.where(np.arange(19) % 2, -0.01, 0.01)
    logs = [late(0.25, wander(0), t_s) for t_s in (even_s, uneven_s)]
    sigma_s = [likelier(fixes)[0].prior_time_offset.sigma_s for fixes in logs]
    assert sigma_s[0] == pytest.approx(sigma_s[1], rel=0.1)


@pytest.mark.slow
def test_each_class_weighs_by_its_own_differences():
    size = np.where(np.arange(19) < 10, 0.1, 3.0)[:, None]  # centimetres per second, then a third of a metre
    errors = [size * (wander(seed) - wander(seed)[9]) for seed in range(20)]
    told = np.where(np.arange(19) < 10, 0, 1)
    mixed = [replace(late(0.2, error), fix_class=told) for error in errors]
    alike = [late(0.2, error) for error in errors]
    found = [
        [by_differences(trajectory(path(T_S)), fixes, NONE, BELIEVED) for fixes in logs]
        for logs in (mixed, alike)
    ]
    off, off_alike = (np.median([abs(one.time_offset_s - 0.2) for one in row]) for row in found)
    assert off < 0.8 * off_alike
    ratio = [(one.time_offset_s - 0.2) / one.sigma_s for one in found[0]]
    assert np.sqrt(np.mean(np.square(ratio))) < 2.0


def test_a_certain_offset_counts_before_a_likelier_one_and_errors_without_memory_get_no_likelier():
    certain, uncertain = late(0.6, wander(0)), late(0.25, wander(3))
    independent = Config(gps=GpsConfig(error_model="independent"))

    def found(fixes, config):
        return estimate_time_offset(SENSORS, trajectory(path(T_S)), fixes, config)

    shown = update_time_offset(SENSORS, trajectory(path(T_S)), certain, SensorsConfig())
    assert plain(found(certain, Config())) == plain(shown)
    likely, notes = found(uncertain, Config())
    assert likely.by_displacements is not None
    found_likely = replace(likely, by_displacements=None), notes
    assert plain(found_likely) == plain(likelier(uncertain)) != plain((SENSORS, ()))
    none, notes = found(uncertain, independent)
    assert (none.time_offset_s, none.prior_time_offset, notes) == (0.0, SENSORS.prior_time_offset, ())


def test_fixes_of_one_class_are_compared_whatever_the_receiver_states():
    """Regions follow the stated sigmas, which differ from fix to fix."""
    fixes, rng = late(0.4, wander(0)), np.random.default_rng(0)
    varied = replace(fixes, r_m=fixes.r_m * rng.uniform(1.0, 1.5, len(fixes)))
    one, other = (by_differences(trajectory(path(T_S)), log, NONE, BELIEVED) for log in (fixes, varied))
    assert one == other
    classes = np.arange(len(fixes)) % 2
    none = by_differences(trajectory(path(T_S)), replace(fixes, fix_class=classes), NONE, BELIEVED)
    assert none == BELIEVED


def agreed(fixes, sensors=SENSORS, **settings):
    return with_agreed_clock(sensors, trajectory(path(T_S)), fixes, SensorsConfig(**settings))


def test_clocks_that_differ_a_little_are_known_by_displacements():
    """A share of what these say, by both variances: they know it to 7 ms here, clocks agree to 20 ms."""
    found = agreed(late(0.04, 1e-3 * wander(0)))
    assert found.prior_time_offset == found.agreed and found.probability == 1.0
    assert 0.005 < found.agreed.sigma_s < 0.008
    assert found.time_offset_s == found.agreed.time_offset_s == pytest.approx(0.035, abs=0.003)


@pytest.mark.parametrize("fixes", [late(0.0, 1e-3 * wander(0)), Fixes.empty()])
def test_clocks_may_agree_exactly_where_nothing_speaks_against_it(fixes):
    assert agreed(fixes) is SENSORS


@pytest.mark.slow
@pytest.mark.parametrize(("sigma_s", "least", "most"), [(0.0, 0, 15), (0.02, 15, 60)])
def test_what_clocks_that_agree_differ_by_has_an_honest_sigma(sigma_s, least, most):
    """Errors that walk by centimetres, and clocks drawn from what is assumed."""
    late_s = np.random.default_rng(0).normal(0.0, sigma_s, 60)
    found = [agreed(late(one_s, 0.3 * wander(seed))).agreed for seed, one_s in enumerate(late_s)]
    errors = [(one.time_offset_s - late_s[k]) / one.sigma_s for k, one in enumerate(found) if one is not None]
    assert least <= len(errors) <= most
    assert np.sqrt(np.mean(np.square(errors))) < 1.5


def test_frame_times_that_err_alike_are_unknown_even_so():
    nothing, little = (
        agreed(fixes, frame_time_sigma_s=0.015).agreed for fixes in (Fixes.empty(), late(0.02, wander(0)))
    )
    assert nothing == TimeOffset(0.0, pytest.approx(0.025))
    assert 0.02 < little.sigma_s < 0.025 and abs(little.time_offset_s) < 0.02


def test_a_time_offset_that_is_certain_stays_and_a_likelier_one_may_be_taken_back():
    fixes = late(0.06, 1e-3 * wander(0))
    other = SENSORS.with_time_offset(TimeOffset(0.4, 0.03))
    assert agreed(fixes, other) is other
    doubted = agreed(fixes, SENSORS.with_time_offset(TimeOffset(0.07, 0.02), 0.7))
    assert doubted.prior_time_offset == TimeOffset(0.07, 0.02) and doubted.probability == 0.7
    assert doubted.agreed.time_offset_s == pytest.approx(0.05, abs=0.005)
