"""The comparison of stage C with iSAM2 is fair: an independent truth, the same observations for all."""

from copy import copy

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from solutions import (
    NORTH_R_CAMERA,
    PINHOLE,
    make_fixes,
    make_gps_log,
    make_landmarks,
    make_poses,
    make_solution,
)

from scripts.benchmarks.window.__main__ import run
from scripts.benchmarks.window.methods import HeldWindow, Incremental
from scripts.benchmarks.window.replay import Replay, batches
from vgps.geometry import project
from vgps.model import FixClass
from vgps.solution import Observations, Verdict

FRAMES, LENGTH, EVERY = 40, 12, 4
LIMIT_RAD = np.radians(1.0)


@pytest.fixture(scope="module")
def replay():
    """A camera that drives north past a cloud of points; the run's poses are off by a metre to the east."""
    rng = np.random.default_rng(0)
    positions = np.column_stack([np.zeros(FRAMES), 0.5 * np.arange(FRAMES), np.zeros(FRAMES)])
    true = make_poses(positions, NORTH_R_CAMERA)
    points = np.column_stack([rng.uniform(-8, 8, 300), rng.uniform(5, 40, 300), rng.uniform(-3, 3, 300)])
    uv, depth = project(PINHOLE.K, true, points)
    inside = (depth > 1) & ((uv > 0) & (uv < (PINHOLE.width, PINHOLE.height))).all(axis=2)
    frame, landmark = np.nonzero(inside)
    east_m = np.array([1.0, 0.0, 0.0])
    fixes = np.arange(1.03, 3.9, 0.2)
    antenna = np.column_stack([np.zeros(len(fixes)), 5.0 * fixes, np.zeros(len(fixes))])
    shifted = true.copy()
    shifted[:, :3, 3] += east_m
    count = len(fixes)
    table = make_fixes(antenna, verdict=(Verdict.REJECTED,) + (Verdict.USED,) * (count - 1))
    solution = make_solution(
        t_s=np.arange(FRAMES) / 10,
        world_T_camera=shifted,
        landmarks=make_landmarks(points + east_m),
        observations=Observations(frame, landmark, uv[frame, landmark]),
        gps=make_gps_log(fixes, (FixClass.RTK_FIX,) * count),
        fixes=table,
    )
    return Replay(solution, true)


@pytest.fixture(scope="module")
def fed(replay):
    return batches(replay, EVERY, LENGTH, LIMIT_RAD)


def test_starts_lie_about_the_truth_not_about_the_run(replay):
    first = np.unique(replay.landmark, return_index=True)[1]
    owner = replay.landmark[first]
    ray = replay.points[owner] - replay.true[replay.frame[first], :3, 3]
    np.testing.assert_allclose(ray / np.linalg.norm(ray, axis=1)[:, None], replay.rays[first], atol=1e-12)
    assert len(replay.fixes) == 14  # the rejected one is left out


def test_batches_hold_each_observation_once_and_only_of_the_window(replay, fed):
    rows = np.concatenate([batch.rows for batch in fed])
    assert len(np.unique(rows)) == len(rows) > 1000
    for batch in fed:
        frames = replay.frame[batch.rows]
        assert ((frames > batch.last - LENGTH) & (frames <= batch.last)).all()


def test_a_landmark_begins_with_three_views_and_parallax(replay, fed):
    seen = set()
    for batch in fed:
        owners = replay.landmark[batch.rows]
        for landmark in set(owners.tolist()) - seen:
            rays = replay.rays[batch.rows[owners == landmark]]
            assert len(rays) >= 3 and np.arccos((rays @ rays.T).clip(-1, 1)).max() >= LIMIT_RAD - 1e-9
        seen |= set(owners.tolist())


def frames_given(replay, landmark):
    given = batches(replay, EVERY, LENGTH, LIMIT_RAD)
    rows = np.concatenate([batch.rows for batch in given])
    return replay.frame[rows[replay.landmark[rows] == landmark]]


def test_a_landmark_that_has_left_the_window_is_not_given_again(replay):
    counts = np.bincount(replay.landmark)
    always = np.flatnonzero(counts == FRAMES)
    landmark = next(one for one in always if len(frames_given(replay, one)) == FRAMES)
    interrupted = copy(replay)
    kept = (replay.landmark != landmark) | (replay.frame < LENGTH) | (replay.frame >= 30)
    for name in ("frame", "landmark", "uv", "rays"):
        setattr(interrupted, name, getattr(replay, name)[kept])
    assert frames_given(interrupted, landmark).tolist() == list(range(LENGTH))


def test_every_method_uses_every_observation_of_the_batches(replay, fed):
    held = HeldWindow(replay, FRAMES)  # as long as the drive: nothing leaves it
    everything = Incremental(replay, None)
    for batch in fed:
        held.update(batch)
        everything.update(batch)
    assert sorted(held.rows.tolist()) == sorted(np.concatenate([batch.rows for batch in fed]).tolist())
    factors = everything.smoother.getFactorsUnsafe()
    kinds = [type(factors.at(k)) for k in range(factors.size())]
    assert kinds.count(gtsam.GenericProjectionFactorCal3_S2) == len(held.rows)


@pytest.mark.parametrize("make", [lambda r: HeldWindow(r, LENGTH), lambda r: Incremental(r, None)])
def test_errors_are_against_the_truth(replay, fed, make):
    result = run(make(replay), replay, fed)
    assert result.failure == "" and len(result.errors_m) == len(fed)
    assert max(result.errors_m) < 0.1  # the run itself is a metre off


def test_the_fixed_lag_smoother_forgets_what_the_window_holds(replay, fed):
    lagged = Incremental(replay, LENGTH / 10)
    assert run(lagged, replay, fed).failure == ""
    assert not lagged.estimate.exists(X(FRAMES - LENGTH - 2)) and lagged.estimate.exists(X(FRAMES - 1))


def test_a_failure_is_reported_and_ends_the_method(replay, fed):
    class Failing(HeldWindow):
        def update(self, batch):
            if batch.first:
                raise RuntimeError("\nIndeterminant linear system near x3\nmore")
            super().update(batch)

    result = run(Failing(replay, LENGTH), replay, fed)
    assert result.failure == "failed at frame 7: Indeterminant linear system near x3"
    assert len(result.seconds) == 1
