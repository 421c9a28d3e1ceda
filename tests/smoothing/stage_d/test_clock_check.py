"""The time offset that the poses of stage D show: against the truth, chance, and the solver's marginals."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from plain_values import plain
from synthetic_bundle import ANTENNA, TIGHT
from synthetic_map import away, context, map_of, scene

from vgps.config import Config
from vgps.errors import GeometryError
from vgps.gps.fixes import CLASSES
from vgps.gps.sensors import TIME_OFFSET, Sensors, TimeOffset
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.model import FixClass
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_d import batch, clock_check
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.smoothing.stage_d.sensor_steps import least_cost_step
from vgps.solver.bundle_adjustment import solve
from vgps.solver.marginals import marginal_covariances

HELD = Sensors.fixed(ANTENNA)
SHARP = {"batch": {"video_sigma_scale": 1.0}}  # a video as exact as this one, of a drive that turns gently


def decided(sensors):
    """Return plain sensors without what is unknown of a time offset that is held."""
    return plain(replace(sensors, held_sigma_s=0.0))


def settings(**changes):
    return Config.model_validate(SHARP | changes)


def result(late_s, sensors=HELD, config=None, told=FixClass.RTK_FIX, good=0.0):
    """Return stage D's result for a synthetic drive whose stamps are late, and its mean error; of its fixes
    a share, the first ones, are RTK-fixes whatever the others are told to be."""
    problem, true, _, exact = scene(disturbed=0.2)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    fix_class = np.full(len(exact), CLASSES.index(told))
    fix_class[: round(good * len(exact))] = CLASSES.index(FixClass.RTK_FIX)
    fixes = replace(exact, t_s=exact.t_s + late_s, fix_class=fix_class)
    found = optimise_batch(made, fixes, sensors, context(config or settings()))
    return found, away(found.trajectory.world_T_camera, true)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.2, -0.15])
def test_good_fixes_show_a_time_offset_that_their_displacements_did_not(late_s):
    found, error = result(late_s)
    sigma_s = float(found.time_offset_sigma_s[0])
    assert abs(found.sensors.time_offset_s - late_s) < 3.0 * sigma_s < 0.1
    assert found.sensors.shown_by_poses
    assert error < 0.2 * result(late_s, config=settings(sensors={"estimate_time_offset": "no"}))[1]


@pytest.mark.slow
def test_a_right_clock_stays_as_it_is():
    found, _ = result(0.0)
    assert decided(found.sensors) == plain(HELD) and np.isnan(found.time_offset_sigma_s[0])


@pytest.mark.slow
def test_what_displacements_showed_by_chance_is_taken_back():
    chance = HELD.with_time_offset(TimeOffset(0.15, 0.06), 0.8)
    found, error = result(0.0, chance)
    assert decided(found.sensors) == plain(HELD) and np.isnan(found.time_offset_sigma_s[0])
    assert error < 0.01


def trial(monkeypatch, shown, sensors=HELD, good=4, **clock):
    """Return the sensors that follow, and those tried, where the poses show one time offset after another;
    of four fixes so many are RTK-fixes."""
    config = Config.model_validate({"sensors": clock})
    in_turn = iter(shown)
    fix_class = [CLASSES.index(FixClass.RTK_FIX)] * good + [CLASSES.index(FixClass.SINGLE)] * (4 - good)
    fixes = SimpleNamespace(used=np.ones(4, dtype=bool), fix_class=np.array(fix_class))
    end = SimpleNamespace(problem=SimpleNamespace(shared={TIME_OFFSET: np.array([0.01])}))
    solved = SimpleNamespace(given=SimpleNamespace(context=context(config), fixes=fixes), result=end)
    monkeypatch.setattr(clock_check, "_shown", lambda *_: next(in_turn))
    again = []

    def solve(other):
        again.append(other)
        return solved

    return clock_check.with_shown_clock(sensors, solved, solve)[0], again


@pytest.mark.parametrize(("found_s", "counts"), [(0.14, True), (-0.14, False), (0.02, False)])
def test_a_trial_has_to_confirm_what_was_suspected(monkeypatch, found_s, counts):
    after, again = trial(monkeypatch, [TimeOffset(0.07, 0.02), TimeOffset(found_s, 0.04)])
    assert [one.time_offset_s for one in again] == [0.07]
    assert decided(after) == plain(again[0] if counts else HELD)


@pytest.mark.parametrize(("displacements", "counts"), [((0.02, 0.02), False), ((0.08, 0.02), True)])
def test_a_trial_that_displacements_refute_does_not_count(monkeypatch, displacements, counts):
    """4.2 and 2.1 sigmas from what displacements say; together they make a time offset likely both times."""
    monkeypatch.setattr(clock_check, "_left_unknown", lambda *_: 0.0)
    seen = replace(HELD, by_displacements=TimeOffset(*displacements))
    after, (tried,) = trial(monkeypatch, [TimeOffset(0.07, 0.02), TimeOffset(0.14, 0.02)], seen)
    assert decided(after) == plain(tried if counts else seen)


def test_what_displacements_leave_no_chance_is_not_tried(monkeypatch):
    """As kitti03's gps_float_b, whose floats drift with the video, and its gps_float."""
    monkeypatch.setattr(clock_check, "_left_unknown", lambda *_: 0.0)
    for suspected, displacements in (((0.061, 0.031), (-0.058, 0.021)), ((0.041, 0.026), (0.009, 0.019))):
        seen = replace(HELD, by_displacements=TimeOffset(*displacements))
        after, again = trial(monkeypatch, [TimeOffset(*suspected)], seen)
        assert (decided(after), again) == (plain(seen), [])


def test_a_trial_and_displacements_count_together(monkeypatch):
    """As 30 s of a Septentrio on kitti03, 2.75 sigmas apart: alone the poses make it four times likelier."""
    monkeypatch.setattr(clock_check, "_left_unknown", lambda *_: 0.0)
    shown, alone = [TimeOffset(-0.09, 0.023)] * 2, trial(monkeypatch, [TimeOffset(-0.09, 0.023)] * 2)[0]
    assert alone.shown_by_poses
    seen = replace(HELD, by_displacements=TimeOffset(-0.012, 0.016))
    assert decided(trial(monkeypatch, shown, seen)[0]) == plain(seen)
    told = replace(HELD, by_displacements=TimeOffset(-0.06, 0.016))
    assert trial(monkeypatch, shown, told)[0].shown_by_poses


def test_a_trial_that_knows_little_more_than_the_prior_does_not_count(monkeypatch):
    """As where a wrong height of the camera stretches the path: 0.72 s, one sigma 0.47 s."""
    monkeypatch.setattr(clock_check, "_left_unknown", lambda *_: 0.0)
    after, again = trial(monkeypatch, [TimeOffset(1.8, 0.3), TimeOffset(0.72, 0.47)])
    assert len(again) == 1 and decided(after) == plain(HELD)


def test_what_a_trial_finds_is_held_unless_most_fixes_are_rtk_fixes(monkeypatch):
    """The end of the trial is 0.01 s from its start, which moves what was found."""
    found = TimeOffset(0.14, 0.04)
    after, again = trial(monkeypatch, [TimeOffset(0.07, 0.02), found], good=2)
    assert [one.time_offset_s for one in again] == [0.07]
    assert not after.shown_by_poses and after.prior_time_offset == found and 0.5 < after.probability < 1.0
    assert after.moved({TIME_OFFSET: np.array([0.01])}).time_offset_s == pytest.approx(0.14)


@pytest.mark.slow
def test_a_trial_finds_all_of_what_the_poses_show_in_part():
    """A gentle drive with a video that counts little: its step is 0.16 of 0.3 s, with a sigma of 0.13 s."""
    found, error_m = result(0.3, config=Config())
    assert found.sensors.time_offset_s == pytest.approx(0.3, abs=0.005) and error_m < 0.02


@pytest.mark.parametrize(
    ("good", "prior", "improved"),
    [
        (3, TimeOffset(0.0, 0.5), True),  # their poses compare the displacements again
        (2, TimeOffset(0.2, 0.02), True),
        (1, TimeOffset(0.2, 0.02), True),
        (0, TimeOffset(0.2, 0.02), False),
    ],
)
def test_places_of_rtk_fixes_improve_what_is_certain(monkeypatch, good, prior, improved):
    certain = HELD.with_time_offset(TimeOffset(0.2, 0.02))
    expected = replace(certain, prior_time_offset=prior, shown_by_poses=improved)
    assert plain(trial(monkeypatch, [], certain, good)) == (plain(expected), [])


@pytest.mark.slow
@pytest.mark.parametrize("told", [FixClass.RTK_FIX, FixClass.RTK_FLOAT])
def test_a_rough_solution_improves_what_is_certain_if_there_are_rtk_fixes(told):
    """Else the calibration that is refined by it would suit the time offset that was held."""
    problem, true, _, exact = scene(disturbed=0.2)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    fixes = replace(
        exact, t_s=exact.t_s + 0.2, fix_class=np.full(len(exact), CLASSES.index(told), dtype=np.int64)
    )
    one_round = replace(context(settings(batch={"video_sigma_scale": 1.0, "rounds": 1})), rough=True)
    certain = HELD.with_time_offset(TimeOffset(0.25, 0.05))
    found = optimise_batch(made, fixes, certain, one_round).sensors.time_offset_s
    assert found == (pytest.approx(0.2, abs=0.02) if told is FixClass.RTK_FIX else 0.25)


def test_what_is_within_a_sigma_is_not_tried(monkeypatch):
    after, again = trial(monkeypatch, [TimeOffset(0.025, 0.02)])
    assert (decided(after), again) == (plain(HELD), [])


@pytest.mark.parametrize(
    ("shown", "unknown_s"),
    [
        (TimeOffset(0.0, 0.5), np.sqrt(0.5) * 0.5),  # the prior, any time offset half of the time
        (TimeOffset(0.0, 0.1), np.sqrt(0.169) * 0.1),  # 0.102 s alone: 1 / 0.510 against 1 / 0.104
        (TimeOffset(0.002, 0.002), np.sqrt(0.0388) * 0.00283),
    ],
)
def test_what_the_poses_leave_open_of_a_held_time_offset_is_kept(monkeypatch, shown, unknown_s):
    after, _ = trial(monkeypatch, [shown])
    assert after.held_sigma_s == pytest.approx(unknown_s, rel=0.01)
    assert not after.is_estimated


OPEN = replace(HELD, by_displacements=TimeOffset(0.0, 0.1))
OPEN_S = np.sqrt(0.169) * 0.1  # as above
CLAIMED = TimeOffset(0.0, 0.005)  # by the poses


def asked(monkeypatch, costs, r_m=0.1, speed_m_s=10.0):
    """Return the sensors that follow where poses claim to know the time offset better than displacements, and
    the time offsets at which they are asked; each solution has the next of the costs."""
    monkeypatch.setattr(clock_check, "_shown", lambda *_: CLAIMED)
    again = []
    path = SimpleNamespace(length_m=10.0 * speed_m_s, t_s=np.array([0.0, 10.0]))
    fixes = SimpleNamespace(used=np.ones(1, dtype=bool), fix_class=np.zeros(1), r_m=np.array([r_m]))
    given = SimpleNamespace(context=context(Config()), fixes=fixes, scene=SimpleNamespace(trajectory=path))

    def of_cost(cost):
        report = SimpleNamespace(cost_after={"video": cost - 1.0, "poses": 1.0})
        return SimpleNamespace(given=given, result=SimpleNamespace(report=report))

    def solve(other):
        again.append(other.time_offset_s)
        if np.isnan(cost := costs[len(again) - 1]):
            raise GeometryError("the optimiser made no step")
        return of_cost(cost)

    return clock_check.with_shown_clock(OPEN, of_cost(100.0), solve)[0], again


def test_what_poses_claim_holds_if_the_ends_of_what_displacements_leave_open_cost_as_much(monkeypatch):
    ends_s = 2.0 * OPEN_S * np.array([-1.0, 1.0])
    sure, again = asked(monkeypatch, 100.0 + 0.5 * (ends_s / 0.005) ** 2)
    alone, _ = trial(monkeypatch, [CLAIMED])
    assert again == pytest.approx(ends_s, rel=0.01)
    assert sure.held_sigma_s == pytest.approx(alone.held_sigma_s, rel=0.02)


def test_what_poses_claim_is_no_surer_than_the_cost_of_the_ends(monkeypatch):
    """A sixteenth of what the claim lets expect at one of them."""
    after, _ = asked(monkeypatch, [1e3, 100.0 + 0.5 * (2.0 * OPEN_S / 0.02) ** 2])
    alone, _ = trial(monkeypatch, [TimeOffset(0.0, 0.02)])
    assert after.held_sigma_s == pytest.approx(alone.held_sigma_s, rel=0.02)


@pytest.mark.parametrize("costs", [(100.5, 60.0), (150.0, np.nan)])
def test_where_no_end_confirms_what_poses_claim_displacements_say_what_is_unknown(monkeypatch, costs):
    """An end that costs no more, as on an orbit at constant speed, or one that has no solution."""
    after, _ = asked(monkeypatch, costs)
    assert after.held_sigma_s == pytest.approx(OPEN_S, rel=0.01)


@pytest.mark.parametrize("given", [{"r_m": 1.0}, {"speed_m_s": 1.0}])
def test_poses_are_not_asked_where_it_hardly_matters(monkeypatch, given):
    """0.4 m along the path are within the regions of coarse fixes, and 4 cm within those of good ones."""
    after, again = asked(monkeypatch, [], **given)
    assert again == [] and after.held_sigma_s < 0.1 * OPEN_S


@pytest.mark.slow
def test_what_may_be_chance_is_taken_back_where_a_trial_fails(monkeypatch):
    def failing(*_):
        raise GeometryError("not determined")

    chance = HELD.with_time_offset(TimeOffset(0.15, 0.06), 0.8)
    monkeypatch.setattr(clock_check, "least_cost_step", failing)
    found, error = result(0.0, chance)
    assert decided(found.sensors) == plain(HELD) and error < 0.01


@pytest.mark.slow
def test_what_displacements_showed_is_improved():
    shown = HELD.with_time_offset(TimeOffset(0.25, 0.05))
    found, _ = result(0.2, shown)
    assert abs(found.sensors.time_offset_s - 0.2) < 3.0 * float(found.time_offset_sigma_s[0]) < 0.06
    assert found.sensors.prior_time_offset == TimeOffset(0.0, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_many_noisy_fixes_do_not_know_a_time_offset_that_their_motion_does_not_show(seed):
    """One a frame, with errors of 5 mm: two extrapolated poses would follow these, at other time offsets."""
    late_s, shown = 0.2, HELD.with_time_offset(TimeOffset(0.15, 0.03))
    problem, true, t_s, exact = scene(disturbed=0.2)
    antenna = true[:, :3, 3] + true[:, :3, :3] @ ANTENNA
    noise = np.random.default_rng(seed).normal(0.0, 0.005, (len(t_s) - 1, 3))
    fixes = replace(
        exact.where(np.zeros(len(noise), dtype=np.int64)),
        t_s=t_s[:-1] + 0.03 + late_s,
        world_p_fix=0.7 * antenna[:-1] + 0.3 * antenna[1:] + noise,
        fix_class=np.full(len(noise), CLASSES.index(FixClass.RTK_FIX)),
    )
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    few = Config(tracking={"min_inliers": 4})  # as the drive's first frames have: no tear
    found = optimise_batch(made, fixes, shown, context(few))
    sigma_s = float(found.time_offset_sigma_s[0])
    assert abs(found.sensors.time_offset_s - late_s) < 3.0 * sigma_s < 0.03
    assert away(found.trajectory.world_T_camera, true) < 0.05


@pytest.mark.slow
def test_coarse_fixes_do_not_improve_what_their_displacements_showed():
    shown = HELD.with_time_offset(TimeOffset(0.25, 0.05))
    found, _ = result(0.2, shown, told=FixClass.RTK_FLOAT)
    assert plain(found.sensors) == plain(shown) and found.time_offset_sigma_s == [0.05]


@pytest.mark.slow
def test_rtk_fixes_among_more_floats_improve_what_displacements_showed():
    shown = HELD.with_time_offset(TimeOffset(0.25, 0.03))
    found, error = result(0.2, shown, settings(), FixClass.RTK_FLOAT, good=0.4)
    assert found.sensors.prior_time_offset == shown.prior_time_offset
    assert abs(found.sensors.time_offset_s - 0.2) < 3.0 * float(found.time_offset_sigma_s[0]) < 0.06
    assert error < 0.5 * result(0.2, shown, settings(), FixClass.RTK_FLOAT)[1]  # held


@pytest.mark.slow
def test_the_configured_time_offset_is_the_one_that_is_doubted():
    given = Sensors.fixed(ANTENNA, 0.2)
    found, _ = result(0.2, given, settings(sensors={"time_offset_s": 0.2}))
    assert decided(found.sensors) == plain(given)


@pytest.mark.slow
def test_what_is_unknown_of_a_held_time_offset_is_in_the_standard_deviations():
    """Along the path, by its speed; a clock that the settings trust is known."""
    trusted = Config.model_validate({"sensors": {"estimate_time_offset": "no"}})
    (unknown, _), (known, _) = result(0.0, config=Config()), result(0.0, config=trusted)
    speed_m_s = unknown.trajectory.length_m / np.ptp(unknown.trajectory.t_s)
    added = [np.trace(one.covariance[:, 3:, 3:].mean(axis=0)) for one in (unknown, known)]
    assert unknown.sensors.held_sigma_s > 0.0 == known.sensors.held_sigma_s
    assert added[0] - added[1] == pytest.approx((unknown.sensors.held_sigma_s * speed_m_s) ** 2, rel=0.3)


A_LITTLE, CONFIRMED = TimeOffset(0.004, 0.01), TimeOffset(0.03, 0.01)
AGREED = replace(HELD.with_time_offset(A_LITTLE), agreed=A_LITTLE)


@pytest.mark.parametrize(("good", "prior"), [(4, TimeOffset(0.0, 0.02)), (2, A_LITTLE)])
def test_what_clocks_that_agree_differ_by_is_estimated(monkeypatch, good, prior):
    """Poses of RTK-fixes compare displacements again. What else may be unknown is less."""
    monkeypatch.setattr(clock_check, "_left_unknown", lambda *_: 0.015)
    after, again = trial(monkeypatch, [CONFIRMED, TimeOffset(0.005, 0.01)], AGREED, good)
    assert plain(after) == plain(replace(AGREED, prior_time_offset=prior, shown_by_poses=True)) and not again


def test_what_is_unknown_of_the_clock_comes_on_top_of_what_clocks_that_agree_differ_by(monkeypatch):
    monkeypatch.setattr(clock_check, "_left_unknown", lambda *_: 0.3)
    after, _ = trial(monkeypatch, [TimeOffset(0.005, 0.1)], AGREED, frame_time_sigma_s=0.015)
    assert after.held_sigma_s == 0.3 and after.prior_time_offset == TimeOffset(0.0, pytest.approx(0.025))


def test_clocks_agree_exactly_if_poses_do_not_confirm_what_displacements_said(monkeypatch):
    """As one seed of kitti03's gps_fix; 0.37 to 0.63."""
    after, again = trial(monkeypatch, [TimeOffset(-0.0035, 0.0143), TimeOffset(0.0, 0.01)], AGREED)
    assert decided(after) == plain(HELD) and [one.time_offset_s for one in again] == [0.0]


def test_clocks_that_do_not_agree_are_found_all_the_same(monkeypatch):
    shown = [CONFIRMED, TimeOffset(0.07, 0.02), TimeOffset(0.14, 0.04)]
    after, again = trial(monkeypatch, shown, AGREED)
    assert plain(after) == plain(again[0]) and after.time_offset_s == 0.07


def test_what_may_be_chance_gives_way_to_what_clocks_that_agree_differ_by(monkeypatch):
    """The trial finds too little to be likelier than clocks that agree; the round is solved with those."""
    doubted = replace(AGREED.with_time_offset(TimeOffset(0.05, 0.02), 0.6), agreed=A_LITTLE)
    shown = [TimeOffset(0.02, 0.01), TimeOffset(0.02, 0.02)]
    after, again = trial(monkeypatch, shown, doubted)
    assert [one.time_offset_s for one in again] == [0.05, 0.004]
    assert after.time_offset_s == 0.004 and after.prior_time_offset == TimeOffset(0.0, 0.02)
    assert after.shown_by_poses


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.02, -0.015])
def test_what_clocks_that_agree_differ_by_is_found_within_its_sigma(late_s):
    """Where all frame times err, poses do not have to confirm that clocks do not agree exactly."""
    begun = replace(HELD.with_time_offset(TimeOffset(0.0, 0.02)), agreed=TimeOffset(0.0, 0.02))
    found, error = result(late_s, begun, settings(sensors={"frame_time_sigma_s": 0.01}))
    assert found.sensors.time_offset_s == pytest.approx(late_s, abs=3.0 * found.time_offset_sigma_s[0])
    assert found.time_offset_sigma_s[0] < 0.01
    assert error < 0.5 * result(late_s, config=settings(sensors={"estimate_time_offset": "no"}))[1]


@pytest.mark.slow
def test_what_displacements_make_likely_is_tried_where_the_poses_alone_suspect_nothing():
    """A gentle drive with a video that counts little."""
    assert decided(result(0.2, config=Config())[0].sensors) == plain(HELD)
    found, _ = result(0.2, HELD.with_time_offset(TimeOffset(0.17, 0.1), 0.8), Config())
    assert abs(found.sensors.time_offset_s - 0.2) < 3.0 * float(found.time_offset_sigma_s[0]) < 0.1


@pytest.mark.slow
def test_step_and_covariance_are_those_of_a_solution_with_the_time_offset_free(monkeypatch):
    """With errors of no memory and Gaussian ones the problem is as good as quadratic."""
    seen = []

    def kept(sensors, solved, _):
        seen.append(solved)
        return sensors, solved

    monkeypatch.setattr(batch, "with_shown_clock", kept)
    result(0.02, config=settings(gps={"model": "gaussian"}, batch=SHARP["batch"] | {"robust_px": 1e3}))
    (solved,) = seen
    given, end = solved.given, solved.result.problem
    free = replace(given.sensors, prior_time_offset=TimeOffset(0.0, 0.5))
    step, covariance = least_cost_step(given, end, free, TIME_OFFSET)
    others = replace(given, antenna_velocity=np.zeros((len(given.fixes), 3)))  # those of the path's end count
    np.testing.assert_array_equal(least_cost_step(others, end, free, TIME_OFFSET)[0], step)
    problem = batch.batch_problem(replace(given, sensors=free)).problem
    free_end = solve(problem, TIGHT).problem
    assert step == pytest.approx(free_end.shared[TIME_OFFSET], rel=0.05)
    marginal = marginal_covariances(free_end).shared[TIME_OFFSET]
    assert covariance == pytest.approx(marginal, rel=0.05)
