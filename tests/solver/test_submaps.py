"""A problem solved in submaps on disk has the minimum and the covariances of the whole."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import TIGHT, drive, interrupted_tracks, keep_observations, with_loss
from synthetic_laps import two_laps
from synthetic_states import drive_with_states

from vgps.solver.bundle_adjustment import solve
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.levenberg_marquardt import SolverSettings
from vgps.solver.marginals import marginal_covariances
from vgps.solver.problem import BundleProblem


def short_tracks(problem: BundleProblem, frames: int) -> BundleProblem:
    """Return the problem with the first few frames of every track only."""
    first = np.full(len(problem.world_p_landmark), len(problem.world_T_camera))
    np.minimum.at(first, problem.landmark, problem.frame)
    rows = np.flatnonzero(problem.frame - first[problem.landmark] < frames)
    return keep_observations(problem, rows)


CASES = {
    "long": lambda: (drive(frames=160, landmarks=900)[0], 52),
    "huber": lambda: (with_loss(drive(160, 900, outliers=0.02, disturbed=0.3)[0], "huber"), 52),
    "states and shared vectors": lambda: (short_tracks(drive_with_states(), 5), 16),
    "loops": lambda: (two_laps(), 36),
    "gap": lambda: (short_tracks(interrupted_tracks(), 4), 12),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_minimum_and_covariances_are_those_of_the_whole(case: str) -> None:
    problem, frames = CASES[case]()
    cut = replace(problem, submap_frames=frames)
    assert analyse_sparsity(cut).submaps is not None
    whole, parts = solve(problem, TIGHT), solve(cut, TIGHT)
    assert (whole.report.submaps, parts.solver) == (None, "schur")
    assert parts.report.submaps is not None
    assert len(parts.report.submaps.places) >= 2 and parts.report.submaps.separators[0] == 0
    assert sum(parts.report.cost_after.values()) == pytest.approx(sum(whole.report.cost_after.values()), 1e-9)
    np.testing.assert_allclose(parts.problem.world_T_camera, whole.problem.world_T_camera, rtol=0, atol=1e-6)
    here = whole.problem
    expected, found = (marginal_covariances(one) for one in (here, replace(here, submap_frames=frames)))
    np.testing.assert_allclose(found.poses, expected.poses, rtol=1e-6, atol=1e-12)
    for name in ("shared", "states"):
        for key, block in getattr(expected, name).items():
            np.testing.assert_allclose(getattr(found, name)[key], block, rtol=1e-6, atol=1e-12)


@pytest.mark.slow
def test_what_gtsam_solves_has_no_submaps() -> None:
    problem = replace(drive(frames=160, landmarks=900)[0], submap_frames=52)
    found = solve(problem, SolverSettings(max_flops=0.0, max_iterations=1))
    assert (found.solver, found.report.submaps) == ("gtsam", None)


def test_a_full_disk_is_an_error_of_the_system(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: int) -> None:
        raise OSError(28, "No space left on device")

    problem = replace(drive(frames=160, landmarks=900)[0], submap_frames=52)
    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    with pytest.raises(OSError, match="No space left"):
        solve(problem)
