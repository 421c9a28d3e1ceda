"""Faults of a live session: darkness, updates that fail, outages, and drives without end."""

import gc
import tracemalloc
from dataclasses import dataclass

import numpy as np
import pytest
from fewer_features import fewer_features
from walks import ToAndFro

import vgps
from vgps.config import OnlineConfig
from vgps.errors import GeometryError
from vgps.online import OnlineEstimate, OnlineState
from vgps.online.replay import fixes_of
from vgps.pipeline import stage_c
from vgps.solution import Solution

pytestmark = pytest.mark.slow

FEWER = fewer_features(150)


@pytest.fixture(scope="module")
def walk(recording):
    return ToAndFro(recording)


def notes(estimates):
    return [event.text for estimate in estimates for event in estimate.events if event.kind == "note"]


def test_one_failed_update_is_reported_and_tracking_continues(walk, monkeypatch):
    real, calls = stage_c.optimise_window, []

    def failing(*arguments):
        calls.append(None)
        if len(calls) == 3:
            raise RuntimeError("Indeterminant linear system")
        return real(*arguments)

    monkeypatch.setattr(stage_c, "optimise_window", failing)
    _, estimates = walk.drive(85, FEWER)
    assert any("stage C failed" in note and "Indeterminant" in note for note in notes(estimates))
    assert estimates[-1].state is OnlineState.TRACKED and walk.away(estimates)[-1] < 0.3


def test_updates_that_fail_again_and_again_end_the_map_and_a_new_one_recovers(walk, monkeypatch):
    real, calls = stage_c.optimise_window, []

    def failing(*arguments):
        calls.append(None)
        if 3 <= len(calls) <= 5:
            raise GeometryError("the cost at the start is not finite")
        return real(*arguments)

    monkeypatch.setattr(stage_c, "optimise_window", failing)
    smoother, estimates = walk.drive(150, FEWER)
    states = [estimate.state for estimate in estimates]
    given_up = next(e.frame for e in estimates if any("new map" in event.text for event in e.events))
    assert OnlineState.STARTING in states[given_up:] and states[-1] is OnlineState.TRACKED
    assert walk.away(estimates)[-1] < 0.3
    assert np.isfinite(smoother.finish().world_T_camera).all()


def test_darkness_is_bridged_then_lost_and_ends(walk):
    _, estimates = walk.drive(110, fewer_features(150, online={"bridge_s": 0.3}), dark=range(60, 70))
    states = [estimate.state for estimate in estimates]
    assert states[59] is OnlineState.TRACKED and states[61] is OnlineState.BRIDGED
    assert states[69] is OnlineState.LOST and not estimates[69].posed
    assert states[-1] in {OnlineState.TRACKED, OnlineState.UNALIGNED}
    kinds = [event.kind for estimate in estimates[60:] for event in estimate.events]
    assert "lost" in kinds


@dataclass(frozen=True)
class LongDrive:
    """A drive far longer than what is kept of it, without fixes for longer than that."""

    solution: Solution
    estimates: list[OnlineEstimate]
    counts: np.ndarray  # rows of sizes, of each frame from the 100th on
    bytes_at: list[int]  # when 100 and when 150 frames had been seen


@pytest.fixture(scope="module")
def long_drive(walk):
    counts, bytes_at = [], []

    def count(index, smoother):
        if index in {100, 150}:
            smoother._frame_pipeline.finish_window()  # what stage C is at work with is no growth
            gc.collect()
            bytes_at.append(tracemalloc.get_traced_memory()[0])
        (current,) = smoother._frame_pipeline.maps or [None]
        if current is not None and index >= 100:
            fix_buffer = smoother._frame_pipeline.fix_buffer
            sizes = len(current.poses), current.feature_count, len(current.observations().frame)
            counts.append((*sizes, len(fix_buffer.fixes), len(smoother._verdicts.reported)))

    config = vgps.Config(
        online=OnlineConfig(keep_s=2.0),
        tracking={"max_features": 100, "return_frames": 30},
        mapping={"max_track_frames": 30},
        window={"length_frames": 30},
    )
    tracemalloc.start()
    try:
        smoother, estimates = walk.drive(151, config, silent=range(40, 80), each=count)
    finally:
        tracemalloc.stop()
    return LongDrive(smoother.finish(), estimates, np.array(counts), bytes_at)


def test_tracking_continues_after_an_outage_longer_than_the_retention(walk, long_drive):
    estimates = long_drive.estimates
    assert all(estimate.state is OnlineState.TRACKED for estimate in estimates[40:])
    away = walk.away(estimates)
    assert np.mean(away[-50:]) < 0.3
    smooth = np.array([estimate.local_T_camera[:3, 3] for estimate in estimates[40:]])
    # walking at 1.5 m/s, and blending at 1 m/s at most
    assert np.linalg.norm(np.diff(smooth, axis=0), axis=1).max() < 2.6 / 15


def test_memory_does_not_grow(walk, long_drive):
    counts, bytes_at, solution = long_drive.counts, long_drive.bytes_at, long_drive.solution
    first, last = counts[:25].max(axis=0), counts[-25:].max(axis=0)
    assert (last <= 1.3 * first).all()
    assert last[0] <= 95 and last[3] <= 2 * 2 + 4
    assert bytes_at[1] - bytes_at[0] < 350_000  # 50 frames' pictures alone would be 4 MB
    assert len(solution.t_s) == 151 and np.isfinite(solution.world_T_camera).all()
    away = np.linalg.norm(
        solution.world_T_camera[40:, :3, 3] - walk.true[[walk.row(k) for k in range(40, 151)], :3, 3], axis=1
    )
    assert away.mean() < 0.2


def test_fixes_from_the_future_are_counted_and_not_kept(walk):
    jumps = []

    def each(index, smoother):
        if index % 5 == 0:
            fix = next(fixes_of(walk.opened.gps))
            jumps.append(smoother.add_fix(fix._replace(t_s=1e6 + index)))

    _, estimates = walk.drive(60, FEWER, each=each)
    assert jumps == [False] * 12
    told = [note for note in notes(estimates) if "the receiver's clock jumped" in note]
    assert [note.split(": ")[1].split()[0] for note in told] == ["1", "10"]
