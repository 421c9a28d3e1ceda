"""Stage C by iSAM2, on the synthetic drive as it grows."""

from dataclasses import replace

import numpy as np
import pytest
from gtsam.symbol_shorthand import L
from synthetic_bundle import ANTENNA, keep_observations
from synthetic_map import CAMERA, away, context, map_of, scene

from vgps.config import Config, StartConfig, WindowConfig
from vgps.mapping.map_update import MapUpdate, Positions
from vgps.smoothing.stage_c import window_factors
from vgps.smoothing.stage_c.fixed_lag import FixedLagGraph
from vgps.smoothing.stage_c.incremental_window import IncrementalWindow
from vgps.smoothing.stage_c.window import optimise_window

pytestmark = pytest.mark.slow

LAST = (19, 29, 39, 49, 59)  # newest frame of each window
TILTED = StartConfig(level_sigma_deg=1e3, pitch_sigma_deg=1e3)  # the drive's world is not east, north, up
WHOLE = Config(window=WindowConfig(length_frames=60, iterations=20), start=TILTED)
SHORT = Config(window=WindowConfig(length_frames=25), start=TILTED)


def tracked_scene():
    """The drive with errors that differ little from frame to frame, as tracking leaves them."""
    return scene(disturbed=0.05)


def grown(problem, last, before=None, aligned=True):
    """The map until a frame, with the poses and points that the windows before have given it."""
    made = map_of(problem, 0, last, aligned=aligned)
    if before is not None:
        known = np.arange(before.feature_count)
        positions = Positions(known, before.points, before.sigma_px)
        made.apply(MapUpdate(first_frame=0, poses=before.poses, positions=positions))
    return made


def windows(problem, fixes_at, config=WHOLE, last=LAST):
    """The map after all windows, and the engine; ``fixes_at`` gives the fixes of a window."""
    engine, local_map = IncrementalWindow(context(config)), None
    for newest in last:
        local_map = grown(problem, newest, local_map)
        local_map.apply(engine.optimise(local_map, fixes_at(newest), ANTENNA).update)
    return local_map, engine


def continues(engine, local_map):
    """Whether the smoother goes on with the map as it is."""
    return engine._graph is not None and engine._knows(local_map)


def test_with_all_frames_in_the_window_it_ends_near_the_minimum():
    problem, true, t_s, fixes = tracked_scene()
    local_map, engine = windows(problem, lambda newest: fixes.until(t_s[newest]))
    assert continues(engine, local_map) and engine.failures == 0
    whole = grown(problem, 59)
    for _ in range(3):
        whole.apply(optimise_window(whole, fixes, ANTENNA, context(WHOLE)).update)
    # observations keep the weights with which they came
    assert away(local_map.poses, true) < 1.5 * away(whole.poses, true) < 0.05


def test_fixes_leave_when_they_are_rejected_and_come_late(monkeypatch):
    problem, _, t_s, fixes = tracked_scene()
    local_map, engine = windows(problem, lambda newest: fixes.until(t_s[newest]), last=(29, 59))
    entered, left = [], []
    update = FixedLagGraph.update

    def recorded(graph, change, iterations):
        entered.append({name[1] for name in change.factors if name[0] == "fix"})
        left.append({name[1] for name in change.removed if name[0] == "fix"})
        return update(graph, change, iterations)

    monkeypatch.setattr(FixedLagGraph, "update", recorded)
    row = np.arange(len(fixes)) == 10
    lower = replace(fixes, r_m=np.where(row, 1.0, fixes.r_m))
    for given in (replace(fixes, used=~row), fixes, lower):
        local_map.apply(engine.optimise(local_map, given, ANTENNA).update)
    time_s = {fixes.t_s[10]}
    assert entered == [set(), time_s, time_s] and left == [time_s, set(), time_s]


def test_older_frames_leave_the_window_and_stay():
    problem, true, t_s, fixes = tracked_scene()
    local_map, engine = windows(problem, lambda newest: fixes.until(t_s[newest]), SHORT, LAST[:4])
    before = local_map.poses.copy()
    local_map = grown(problem, 59, local_map)
    local_map.apply(engine.optimise(local_map, fixes, ANTENNA).update)
    np.testing.assert_array_equal(local_map.poses[:35], before[:35])
    assert away(local_map.poses[35:], true[35:]) < 0.1 and continues(engine, local_map)


def test_features_without_parallax_follow_the_frames_that_saw_them_last(monkeypatch):
    problem, _, t_s, fixes = tracked_scene()
    monkeypatch.setattr(window_factors, "_MIN_PARALLAX_RAD", np.radians(8.0))
    local_map, engine = windows(problem, lambda newest: fixes.until(t_s[newest]), SHORT, LAST[:3])
    before = grown(problem, 49, local_map)
    high = replace(fixes, world_p_fix=fixes.world_p_fix + np.array([0.0, 0.0, 3.0]))
    after = before.snapshot()
    after.apply(engine.optimise(after, high, ANTENNA).update)
    log = before.observations(25)
    last = np.full(before.feature_count, -1)
    last[log.landmark] = log.frame
    outside = [k for k in np.flatnonzero(last >= 25).tolist() if L(k) not in engine._graph]
    assert away(after.poses[25:], before.poses[25:]) > 0.1 and len(outside) > 10
    for k in outside:
        old, new = before.pose(last[k]), after.pose(last[k])
        in_camera = (before.points[k] - old[:3, 3]) @ old[:3, :3]
        np.testing.assert_allclose((after.points[k] - new[:3, 3]) @ new[:3, :3], in_camera, atol=1e-9)


def test_a_map_that_something_else_moved_is_taken_up_anew():
    problem, _, t_s, fixes = tracked_scene()
    local_map, engine = windows(problem, lambda newest: fixes.until(t_s[newest]), SHORT, LAST[:3])
    assert continues(engine, local_map)
    other = local_map.poses.copy()
    other[:, :3, 3] += 0.1
    local_map.apply(MapUpdate(first_frame=0, poses=other))
    assert not continues(engine, local_map)
    plain = optimise_window(local_map, fixes, ANTENNA, context(SHORT)).update
    np.testing.assert_array_equal(engine.optimise(local_map, fixes, ANTENNA).update.poses, plain.poses)
    assert engine.failures == 0


def test_where_isam2_fails_the_window_is_that_of_the_other_solver(monkeypatch):
    problem, _, t_s, fixes = tracked_scene()
    local_map, engine = windows(problem, lambda newest: fixes.until(t_s[newest]), SHORT, LAST[:3])
    grown_map = grown(problem, 49, local_map)

    def indeterminate(*_):
        raise RuntimeError("Indeterminate linear system detected while working near variable")

    with monkeypatch.context() as patch:
        patch.setattr(FixedLagGraph, "update", indeterminate)
        found = engine.optimise(grown_map, fixes, ANTENNA).update
    assert engine.failures == 1
    np.testing.assert_array_equal(
        found.poses, optimise_window(grown_map, fixes, ANTENNA, context(SHORT)).update.poses
    )
    grown_map.apply(found)
    again = grown(problem, 59, grown_map)
    again.apply(engine.optimise(again, fixes, ANTENNA).update)
    assert continues(engine, again) and engine.failures == 1


def test_a_frame_that_nothing_ties_is_left_to_the_other_solver():
    problem, _, t_s, fixes = tracked_scene()
    problem = keep_observations(problem, problem.frame != 45)
    local_map, engine = windows(problem, lambda newest: fixes.until(t_s[newest]), SHORT, LAST[:3])
    grown_map = grown(problem, 49, local_map)
    found = engine.optimise(grown_map, fixes, ANTENNA).update
    plain = optimise_window(grown_map, fixes, ANTENNA, context(SHORT)).update
    np.testing.assert_array_equal(found.poses, plain.poses)
    assert engine.failures == 0


def test_rolling_shutters_are_left_to_the_other_solver():
    problem, _, _, fixes = tracked_scene()
    rolling = replace(context(SHORT), camera=replace(CAMERA, readout_s=0.02))
    engine = IncrementalWindow(rolling)
    for newest in LAST[:2]:
        local_map = grown(problem, newest)
        local_map.apply(engine.optimise(local_map, fixes, ANTENNA).update)
    assert not continues(engine, local_map)


def test_a_map_outside_the_world_keeps_its_scale():
    problem, true, _, fixes = scene(disturbed=0.1)
    engine, local_map = IncrementalWindow(context(SHORT)), None
    for newest in LAST:
        local_map = grown(problem, newest, local_map, aligned=False)
        local_map.apply(engine.optimise(local_map, fixes, ANTENNA).update)
    assert continues(engine, local_map)
    length, true_length = (
        np.linalg.norm(np.diff(x[:, :3, 3], axis=0), axis=1).sum() for x in (local_map.poses, true)
    )
    assert abs(length / true_length - 1.0) < 0.05
