"""What the selection panel shows of poses, landmarks and fixes."""

from dataclasses import replace

import pytest

from vgps.solution import Solution
from vgps.viewer.residuals import reproject
from vgps.viewer.run_index import RunIndex
from vgps.viewer.selection_details import fix_details, landmark_details, pose_details


@pytest.fixture
def run(solution: Solution) -> RunIndex:
    return RunIndex(solution, reproject(solution))


def test_a_pose_states_its_factors_and_residuals(run: RunIndex) -> None:
    first = pose_details(run, 0)
    assert "3 projection factors: rms 0.58 px, largest 1.00 px, Phi = 0.667" in first.details
    assert "fix 0 (line 3) at 0.03 s: rtk_fix, used" in first.details
    assert (first.factors, first.residual) == ("3 video, 1 gps", "rms 0.58 px")
    assert "fix 0" in pose_details(run, 1).details  # the factor acts on both frames around the fix
    bridged = pose_details(run, 3)
    assert "fix 3" not in bridged.details  # rejected: no factor
    assert bridged.verdict == "bridged"


def test_a_landmark_states_its_residuals(run: RunIndex) -> None:
    details = landmark_details(run, 0)
    assert "sigma_j = 0.50 px" in details.details
    assert "frame 0: u -0.60, v +0.80 px" in details.details
    assert (details.factors, details.cost) == ("6 in 0 to 5", "sigma_j 0.50 px")


def test_a_fix_states_its_residual_and_its_term(run: RunIndex) -> None:
    used = fix_details(run, 1)
    assert "east -1.200, north +0.000, up +3.000 m" in used.details
    assert "omega Psi = 0.0625" in used.details and "acts on frames 1 and 2" in used.details
    assert (used.residual, used.cost) == ("-1.20 +0.00 +3.00 m", "0.50 r, 0.50 h: 0.062")
    assert used.factors == "frames 1, 2"
    rejected = fix_details(run, 3)
    assert "no term in the energy" in rejected.details
    assert (rejected.factors, rejected.cost) == ("none", "300.00 r, 0.00 h")
    assert rejected.verdict == "rtk_fix, rejected"


def test_a_time_offset_is_stated(run: RunIndex, late: Solution) -> None:
    shifted = fix_details(RunIndex(late, reproject(late)), 1).details.splitlines()
    assert shifted.pop() == "time stamp 0.38 s, of which +0.250 s is the time offset"
    assert shifted == fix_details(run, 1).details.splitlines()


def test_a_time_offset_that_grows_is_that_of_the_fix(late: Solution) -> None:
    faster = replace(late, sensors=replace(late.sensors, clock_rate=0.2))
    details = fix_details(RunIndex(faster, reproject(faster)), 1).details.splitlines()
    assert details[-1] == "time stamp 0.38 s, of which +0.326 s is the time offset"


def test_each_entry_fits_a_line_of_the_panel(run: RunIndex) -> None:
    shown = [*(pose_details(run, k) for k in range(6)), *(landmark_details(run, k) for k in range(3))]
    shown += [fix_details(run, k) for k in range(4)]
    for one in shown:
        assert max(map(len, (one.what, one.factors, one.residual, one.cost, one.verdict))) <= 28
