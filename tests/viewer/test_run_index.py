"""Rows of observations and fixes by frame and by landmark."""

from dataclasses import replace

import numpy as np

from vgps.solution import Solution
from vgps.viewer.residuals import reproject
from vgps.viewer.run_index import RunIndex


def test_rows_of_a_frame_and_of_a_landmark(solution: Solution) -> None:
    keep = (solution.observations.frame != 2) | (solution.observations.landmark == 1)
    columns = {name: getattr(solution.observations, name)[keep] for name in ("frame", "landmark", "uv_px")}
    fewer = replace(solution, observations=replace(solution.observations, **columns))
    run = RunIndex(fewer, reproject(fewer))
    assert run.observations.landmark[run.rows_of_frame(2)].tolist() == [1]
    assert sorted(run.observations.landmark[run.rows_of_frame(3)].tolist()) == [0, 1, 2]
    rows = run.rows_of_landmark(0)
    np.testing.assert_array_equal(run.observations.landmark[rows], 0)
    assert run.observations.frame[rows].tolist() == [0, 1, 3, 4, 5]


def test_a_used_fix_acts_on_the_frames_before_and_after_it(solution: Solution) -> None:
    run = RunIndex(solution, reproject(solution))
    # fixes 0 to 2 at 0.03, 0.13, 0.23 s; 3 is rejected, 4 not used
    assert run.fixes_of_frame == {0: [0], 1: [0, 1], 2: [1, 2], 3: [2]}
    without = replace(solution, gps=None, fixes=None)
    assert RunIndex(without, reproject(without)).fixes_of_frame == {}
