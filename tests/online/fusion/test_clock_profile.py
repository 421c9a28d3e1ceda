from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ARM, DrivingCamera, fit_input, fixed_then_float

from vgps.config import Config
from vgps.gps.sensors import TimeOffset
from vgps.model import FixClass
from vgps.online.fusion import clock_profile, fusion_fit
from vgps.online.fusion.clock_profile import (
    NOTHING_SHOWN,
    ProfiledClock,
    noisier_than_expected,
    profiled_time_offset,
    unsure_time_offset,
)
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.live_time_offset import LiveTimeOffset
from vgps.online.fusion.path_fusion import fuse

CONFIG = Config()
UNSURE = LiveTimeOffset(0.0, 0.3, 0.3)


def profiled(late_s, believed=UNSURE, config=CONFIG, seed=1, arm=ARM, fixed=2, varying=0.0):
    """What fits at several time offsets prefer on a drive with some RTK-fixes before RTK-floats."""
    drive = DrivingCamera(400, varying)
    fixes = drive.fixes(*fixed_then_float(fixed, 40 - fixed, [0.3, -0.4, 1.0]))
    path = drive.seen(np.random.default_rng(seed), share=0.3)
    fixes = replace(fixes, t_s=fixes.t_s + late_s)
    fused = replace(fuse(path, fixes, arm, config, None), time_offset=believed)
    return profiled_time_offset(path, fixes, fused, config).shown


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("late_s", [-0.3, 0.25])
def test_a_clock_that_makes_floats_walk_is_found(late_s, seed):
    found = profiled(late_s, seed=seed)
    assert found.time_offset_s == pytest.approx(late_s, abs=0.02) and found.sigma_s < 0.2


@pytest.mark.slow
@pytest.mark.parametrize(("late_s", "found_s"), [(0.3, 0.3), (-0.3, -0.3), (0.0, None)])
def test_so_is_one_whose_place_an_unknown_lever_arm_took(late_s, found_s):
    """The fit is sure of no time offset, and its antenna ahead of the camera by the way of that time."""
    arm, sure_of_none = LeverArm.within(np.zeros(3), 1.0), LiveTimeOffset(0.0, 0.01, 0.01)
    found = profiled(late_s, sure_of_none, arm=arm, fixed=40, varying=0.5)
    assert (found and found.time_offset_s) == pytest.approx(found_s, abs=0.05)


def orbiting_walker(late_s, *, steady):
    """Nine seconds about a statue with a bob of 1.7 Hz and ten RTK-fixes a second, and their fit if clocks
    agreed."""
    walk, radius_m = DrivingCamera(90), 4.0
    speed_m_s = np.full(90, 1.2) if steady else np.minimum(0.5 * walk.t_s, 1.2)
    turn = 0.1 * np.cumsum(speed_m_s) / radius_m
    zero, bob_m = np.zeros_like(turn), 0.03 * np.sin(2.0 * np.pi * 1.7 * walk.t_s)
    right = np.stack([-np.sin(turn), np.cos(turn), zero], axis=1)
    ahead = np.stack([-np.cos(turn), -np.sin(turn), zero], axis=1)
    walk.true[:, :3, :3] = np.stack([right, np.tile([0.0, 0.0, -1.0], (len(turn), 1)), ahead], axis=2)
    walk.true[:, :3, 3] = -radius_m * ahead + bob_m[:, None] * [0.0, 0.0, 1.0]
    noise_m = 0.003 * np.random.default_rng(0).standard_normal((len(turn), 3))
    fixes = walk.fixes([FixClass.RTK_FIX] * len(turn), noise_m, every=1)
    fixes = replace(fixes, t_s=fixes.t_s + late_s)
    fixes = fixes.where(fixes.t_s <= walk.t_s[-1])
    agreeing = LiveTimeOffset(0.0, 0.01, 0.01)
    fused = replace(fuse(walk.seen(), fixes, ARM, CONFIG, None), time_offset=agreeing)
    return walk, fixes, fused


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.3, 0.2, -0.2])
def test_of_the_periods_of_a_walkers_bob_the_right_one_is_found(late_s):
    walk, fixes, fused = orbiting_walker(late_s, steady=False)
    assert noisier_than_expected(fused)
    found = profiled_time_offset(walk.seen(), fixes, fused, CONFIG)
    assert found.shown.time_offset_s == pytest.approx(late_s, abs=0.03)
    assert found.away_s == pytest.approx(abs(late_s), abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("steady", [True, False])
def test_a_walkers_bob_calls_no_clocks_that_agree_into_question(steady):
    walk, fixes, fused = orbiting_walker(0.0, steady=steady)
    assert not noisier_than_expected(fused)
    assert profiled_time_offset(walk.seen(), fixes, fused, CONFIG) == NOTHING_SHOWN


@pytest.mark.slow
def test_two_that_are_as_likely_are_a_doubt_that_the_standard_deviations_hold():
    """On a circle a time offset is a heading, so that half a period early and late are alike."""
    walk, fixes, fused = orbiting_walker(0.5 / 1.7, steady=True)
    found = profiled_time_offset(walk.seen(), fixes, fused, CONFIG)
    assert found.shown is None and found.away_s == pytest.approx(0.5 / 1.7, abs=0.03)
    given = fit_input(walk.seen(), 90, fixes)
    sure, doubting = (
        fusion_fit.fit_with_verdicts(replace(given, clock_away_s=away_s), CONFIG).fused
        for away_s in (0.0, found.away_s)
    )
    assert doubting.time_offset.sigma_s > 1.4 * sure.time_offset.sigma_s
    assert np.trace(doubting.covariance[:3, :3]) > 2.0 * np.trace(sure.covariance[:3, :3])


@pytest.mark.parametrize(("worse", "found_s"), [(1.0, None), (30.0, 0.25)])
def test_of_two_minima_the_better_one_counts_if_the_other_is_much_worse(monkeypatch, worse, found_s):
    drive, costs = DrivingCamera(40), {0.0: worse, 0.25: 0.0}
    fixes = drive.fixes([FixClass.RTK_FIX] * 4, np.zeros((4, 3)))
    fused = replace(fuse(drive.seen(), fixes, ARM, CONFIG, None), time_offset=UNSURE)
    monkeypatch.setattr(clock_profile, "fuse", lambda *given: replace(given[4], nodes=given[4].time_offset))
    monkeypatch.setattr(clock_profile, "cost", lambda held, *_: costs.get(held.time_offset_s, 60.0))
    found = profiled_time_offset(drive.seen(), fixes, fused, CONFIG).shown
    assert (found and found.time_offset_s) == pytest.approx(found_s, abs=0.01)


@pytest.mark.parametrize("by_displacements", [TimeOffset(0.2, 0.01), None])
def test_a_fit_that_watches_the_clock_asks_other_fits_where_displacements_show_nothing(
    monkeypatch, by_displacements
):
    by_fits = TimeOffset(0.3, 0.02)
    monkeypatch.setattr(fusion_fit, "shown_time_offset", lambda *_: by_displacements)
    monkeypatch.setattr(fusion_fit, "profiled_time_offset", lambda *_: ProfiledClock(by_fits))
    drive = DrivingCamera(90)
    fixes = drive.fixes([FixClass.RTK_FIX] * 4, np.zeros((4, 3)))
    last = fuse(drive.seen(), fixes, ARM, CONFIG, None)
    given = fit_input(drive.seen(), 90, fixes, last)
    assert fusion_fit.fit(given, CONFIG).clock.shown is None
    shown = fusion_fit.fit(replace(given, watches_clock=True), CONFIG).clock.shown
    assert shown is (by_displacements or by_fits)


def test_it_asks_fits_at_once_where_the_lever_arm_is_not_known_and_no_others_where_it_is_sure(monkeypatch):
    by_displacements, by_fits = TimeOffset(0.2, 0.01), TimeOffset(0.3, 0.02)
    monkeypatch.setattr(fusion_fit, "shown_time_offset", lambda *_: None)
    monkeypatch.setattr(fusion_fit, "unsure_time_offset", lambda *_: False)
    monkeypatch.setattr(fusion_fit, "profiled_time_offset", lambda *_: ProfiledClock(by_fits))
    drive = DrivingCamera(90)
    fixes = drive.fixes([FixClass.RTK_FIX] * 4, np.zeros((4, 3)))
    last = fuse(drive.seen(), fixes, ARM, CONFIG, None)
    given = replace(fit_input(drive.seen(), 90, fixes, last), watches_clock=True)
    assert fusion_fit.fit(given, CONFIG).clock.shown is None
    monkeypatch.setattr(fusion_fit, "shown_time_offset", lambda *_: by_displacements)
    assert fusion_fit.fit(replace(given, unsure_of_antenna=True), CONFIG).clock.shown is by_fits


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_clocks_that_agree_are_left_alone(seed):
    assert profiled(0.0, seed=seed) is None


@pytest.mark.slow
def test_what_the_fit_knows_as_well_says_nothing_new():
    assert not unsure_time_offset(TimeOffset(0.0, 0.1), CONFIG.sensors)
    assert unsure_time_offset(TimeOffset(0.0, 0.13), CONFIG.sensors)
    assert profiled(0.25, believed=LiveTimeOffset(0.25, 0.2, 0.2)) is None
    held = Config.model_validate({"sensors": {"estimate_time_offset": "no"}})
    assert profiled(0.25, config=held) is None


def test_a_fit_that_fails_tells_nothing(monkeypatch):
    drive = DrivingCamera(40)
    fixes = drive.fixes([FixClass.RTK_FIX] * 4, np.zeros((4, 3)))
    fused = replace(fuse(drive.seen(), fixes, ARM, CONFIG, None), time_offset=UNSURE)

    def fails(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(clock_profile, "fuse", fails)
    assert profiled_time_offset(drive.seen(), fixes, fused, CONFIG) == NOTHING_SHOWN


def test_a_straight_tells_nothing():
    drive = DrivingCamera(120)
    drive.true[:, :3, :3] = drive.true[0, :3, :3]
    drive.true[:, :3, 3] = np.linspace(0.0, 96.0, 120)[:, None] * drive.true[0, :3, 2]
    fixes = drive.fixes(*fixed_then_float(2, 10, [0.3, -0.4, 1.0]))
    fixes = replace(fixes, t_s=fixes.t_s + 0.3)
    fused = fuse(drive.seen(), fixes, ARM, CONFIG, None)
    assert fused.time_offset.sigma_s > 0.3
    assert profiled_time_offset(drive.seen(), fixes, fused, CONFIG) == NOTHING_SHOWN
