from dataclasses import replace

import numpy as np
import pytest
from fused_drives import DrivingCamera, fit_input

import vgps
from vgps.gps.learned_errors import LearnedErrors
from vgps.gps.offset_errors import averaged_over_receivers, between_receivers
from vgps.model import FixClass
from vgps.online.fusion.fusion_fit import fit, newest_fit

CONFIG = vgps.Config()
SINGLE = CONFIG.gps.offset_errors(FixClass.SINGLE)
FRAMES, EVERY = 400, 20


def offsets(step_m, noise_m, seed, fixes=FRAMES // 10):
    """Errors of fixes a second apart, that begin 1.5 m off and walk."""
    rng = np.random.default_rng(seed)
    axes = np.array([1.0, 1.0, SINGLE.vertical])
    walked = np.cumsum(step_m * axes * rng.standard_normal((fixes, 3)), axis=0)
    return np.array([0.8, -0.5, 1.2]) + walked + noise_m * axes * rng.standard_normal((fixes, 3))


def live(wrong, kinds=None, config=CONFIG):
    """Fits as frames come, each from the one before, and the errors (n, 3) of the newest position."""
    drive = DrivingCamera(FRAMES)
    path = drive.seen(np.random.default_rng(5))
    fixes = drive.fixes(kinds or [FixClass.SINGLE] * len(wrong), wrong)
    last, errors = None, []
    for frames in range(3 * EVERY, FRAMES + 1, EVERY):
        now = fit_input(path, frames, fixes, last)
        last = fit(now, config).fused
        errors.append(last.world_T_camera(now.path)[-1, :3, 3] - drive.true[frames - 1, :3, 3])
    return last, np.array(errors)


def learned(step_m, noise_m):
    """Step over a second and noise as learned, the median of three drives."""
    found = [live(offsets(step_m, noise_m, seed))[0].learned[FixClass.SINGLE] for seed in range(3)]
    walk_m, noise_m = np.median([(one.walk_m, one.noise_m) for one in found], axis=0)
    return walk_m * np.sqrt(averaged_over_receivers(SINGLE).rate_lasts_s), noise_m


@pytest.mark.slow
def test_a_good_receiver_a_bad_one_and_a_noisy_one_are_told_apart():
    good, bad, noisy = learned(0.03, 0.02), learned(0.3, 0.02), learned(0.03, 0.3)
    assert 0.02 < good[0] < 0.12
    assert 0.15 < bad[0] < 0.6
    assert 0.15 < noisy[1] < 0.6 and noisy[1] > 3.0 * good[1]
    assert noisy[0] < 0.6 * bad[0]


@pytest.mark.slow
def test_good_fixes_hold_the_path():
    memory = CONFIG.gps.memory.model_copy(update={"learn": False})
    untaught = CONFIG.model_copy(update={"gps": CONFIG.gps.model_copy(update={"memory": memory})})
    size = []
    for config in (CONFIG, untaught):
        runs = [live(offsets(0.01, 0.01, seed), config=config) for seed in range(3)]
        assert bool(runs[0][0].learned) == (config is CONFIG)
        size.append(np.mean([np.linalg.norm(errors[8:], axis=1).mean() for _, errors in runs]))
    assert size[0] < 0.93 * size[1]


def test_few_fixes_leave_the_class_as_it_is():
    drive = DrivingCamera(FRAMES)
    fixes = drive.fixes([FixClass.SINGLE] * 40, offsets(0.01, 0.01, 0))
    learned = fit(fit_input(drive.seen(), 12, fixes), CONFIG).fused.learned[FixClass.SINGLE]
    mean = averaged_over_receivers(SINGLE)
    assert learned.walk_m == pytest.approx(mean.walk_m, rel=0.4)
    assert learned.noise_m == pytest.approx(mean.noise_m, rel=0.4)


def test_a_walk_from_before_the_path_is_not_learned_from():
    drive = DrivingCamera(FRAMES)
    path, fixes = drive.seen(), drive.fixes([FixClass.SINGLE] * 40, np.zeros((40, 3)))
    last = replace(fit(fit_input(path, 105, fixes), CONFIG).fused, learned={})
    now = fit_input(path.since(10.0), 5, fixes.where(fixes.t_s >= 10.0), last)
    again = fit(now, CONFIG).fused
    assert again.nodes.fixes.node.tolist() == [0] and not again.nodes.starts[0]
    assert again.learned[FixClass.SINGLE].walk_m == pytest.approx(averaged_over_receivers(SINGLE).walk_m)


def test_fixes_without_any_error_are_fused_again_and_again():
    drive = DrivingCamera(FRAMES)
    single, last = drive.fixes([FixClass.SINGLE] * 40, np.zeros((40, 3))), None
    for frames in (300, 312, 324):
        last = fit(fit_input(drive.seen(), frames, single, last), CONFIG).fused
    assert last.learned[FixClass.SINGLE].walk_m < 1e-6
    np.testing.assert_allclose(
        last.world_T_camera(drive.seen())[323, :3, 3], drive.true[323, :3, 3], atol=0.01
    )


@pytest.mark.slow
def test_rtk_keeps_the_constants_of_its_classes():
    kinds = [FixClass.RTK_FIX] * 20 + [FixClass.RTK_FLOAT] * 10 + [FixClass.DGPS] * 10
    fused, _ = live(offsets(0.01, 0.01, 0), kinds)
    assert set(fused.learned) == {FixClass.DGPS}


def stretches(size_m, seed, begins=FixClass.DGPS):
    """Classes and errors of RTK-fixes, DGPS, RTK-float, DGPS and RTK-fixes; offsets have this size."""
    kinds = np.repeat([FixClass.RTK_FIX, begins, FixClass.RTK_FLOAT, begins, FixClass.RTK_FIX], 8).tolist()
    offset = (
        size_m * np.random.default_rng(seed).standard_normal((5, 3)) * [[0.0], [1.0], [1.0], [1.0], [0.0]]
    )
    return kinds, np.repeat(offset, 8, axis=0)


def sizes_of(kinds, wrong):
    return live(wrong, kinds)[0].sizes


@pytest.mark.slow
def test_the_size_of_offsets_shows_where_fixes_on_both_sides_determine_them():
    found = {size_m: [sizes_of(*stretches(size_m, seed)) for seed in range(2)] for size_m in (0.05, 4.0)}
    for name in (FixClass.DGPS, FixClass.RTK_FLOAT):
        prior = between_receivers(CONFIG.gps.offset_errors(name))
        small, large = (np.mean([sizes[name] for sizes in found[size_m]]) for size_m in found)
        assert small < 0.4 * prior
        assert large > 1.5 * prior


@pytest.mark.slow
def test_a_size_settles_instead_of_overshooting_with_every_fit():
    kinds, wrong = stretches(0.05, 0)
    drive, last, found = DrivingCamera(FRAMES), None, []
    path, fixes = drive.seen(np.random.default_rng(5)), drive.fixes(kinds, wrong)
    for _ in range(12):
        last = fit(fit_input(path, 240, fixes, last), CONFIG).fused
        found.append(last.sizes[FixClass.RTK_FLOAT])
    assert max(found[-6:]) < 1.6 * min(found[-6:])


@pytest.mark.slow
def test_offsets_right_after_rtk_fixes_leave_the_size_as_it_is():
    kinds, wrong = stretches(0.05, 0)
    after_fix = [FixClass.RTK_FIX] * 8 + [FixClass.RTK_FLOAT] * 8 + [FixClass.RTK_FIX] * 24
    prior = between_receivers(CONFIG.gps.offset_errors(FixClass.RTK_FLOAT))
    goes_on, drawn = sizes_of(after_fix, wrong), sizes_of(kinds, wrong)
    assert set(goes_on) == {FixClass.RTK_FLOAT}
    assert goes_on[FixClass.RTK_FLOAT] > 0.7 * prior
    assert drawn[FixClass.RTK_FLOAT] < 0.4 * prior


def test_known_sizes_bound_the_offsets_of_the_next_fits():
    drive = DrivingCamera(FRAMES)
    single = drive.fixes([FixClass.SINGLE] * 40, np.zeros((40, 3)))
    last = replace(fit(fit_input(drive.seen(), 300, single), CONFIG).fused, sizes={FixClass.SINGLE: 0.1})
    usual = between_receivers(SINGLE)
    now = fit_input(drive.seen(), 312, single, last)
    for fused in (newest_fit(now, CONFIG), fit(now, CONFIG).fused):
        at = np.isfinite(fused.nodes.size_m[:, 0])
        before = last.nodes.size_m[np.isfinite(last.nodes.size_m[:, 0])][0]
        np.testing.assert_allclose(fused.nodes.size_m[at], np.tile(0.1 / usual * before, (at.sum(), 1)))


def down_classed(fixes, rows):
    """Fixes of which some rows were RTK-fixes before verdicts."""
    return replace(fixes, lower_r_m=np.where(rows, fixes.r_m, np.nan))


@pytest.mark.slow
def test_down_classed_fixes_show_nothing_of_the_floats():
    kinds, wrong = stretches(0.05, 0)
    rows = np.arange(40) >= 32  # two fits follow them
    drive, kinds = DrivingCamera(FRAMES), [*kinds[:32], *[FixClass.RTK_FLOAT] * 8]
    path = drive.seen(np.random.default_rng(5))
    fixes = drive.fixes(kinds, np.where(rows[:, None], [2.0, -2.0, 1.0], wrong))
    found = []
    for each in (fixes, down_classed(fixes, rows), fixes.where(~rows)):
        last = None
        for frames in (320, 360, 400):
            last = fit(fit_input(path, frames, each, last), CONFIG).fused
        found.append(last.sizes[FixClass.RTK_FLOAT])
    as_floats, wrong_fixes, without = found
    assert as_floats > 2.0 * without
    assert wrong_fixes == pytest.approx(without, rel=0.3)


def test_while_all_floats_are_down_classed_fixes_their_size_stays():
    drive = DrivingCamera(FRAMES)
    fixes = down_classed(drive.fixes([FixClass.RTK_FLOAT] * 40, np.zeros((40, 3))), np.ones(40, dtype=bool))
    known = {FixClass.RTK_FLOAT: 0.1}
    last = replace(fit(fit_input(drive.seen(), 300, fixes), CONFIG).fused, sizes=known)
    assert fit(fit_input(drive.seen(), 312, fixes, last), CONFIG).fused.sizes == known


def test_a_down_classed_fix_lies_as_far_off_as_floats_of_any_receiver():
    drive, rows = DrivingCamera(FRAMES), np.arange(40) >= 25
    fixes = down_classed(drive.fixes([FixClass.RTK_FLOAT] * 40, np.zeros((40, 3))), rows)
    last = fit(fit_input(drive.seen(), 300, fixes), CONFIG).fused
    usual, small = last.nodes.size_m, {FixClass.RTK_FLOAT: 0.1}
    fused = fit(fit_input(drive.seen(), 300, fixes, replace(last, sizes=small)), CONFIG).fused
    node = fused.nodes.fixes.node
    ratio = fused.nodes.size_m[node] / usual[node]
    of_any = between_receivers(CONFIG.gps.offset_errors(FixClass.RTK_FLOAT))
    np.testing.assert_allclose(ratio[:, 0], np.where(rows[: len(node)], 1.0, 0.1 / of_any))


def test_what_was_learned_counts_in_the_next_fits_and_is_kept_while_there_are_no_such_fixes():
    drive = DrivingCamera(FRAMES)
    single, fixed = (
        drive.fixes([kind] * 40, np.zeros((40, 3))) for kind in (FixClass.SINGLE, FixClass.RTK_FIX)
    )
    known = {FixClass.SINGLE: LearnedErrors(noise_m=0.01, walk_m=0.01, rate_lasts_s=5.0)}
    last = replace(fit(fit_input(drive.seen(), 300, single), CONFIG).fused, learned=known)
    now = fit_input(drive.seen(), 312, single, last)
    for fused in (newest_fit(now, CONFIG), fit(now, CONFIG).fused):
        np.testing.assert_allclose(fused.nodes.fixes.noise_m[:, 0], 0.01)
    assert fit(fit_input(drive.seen(), 312, fixed, last), CONFIG).fused.learned == known
