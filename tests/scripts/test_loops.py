"""The benchmark of places seen again: how far apart tied frames are by the truth."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from solutions import make_poses, make_solution

from scripts.benchmarks.loops import distances_m
from vgps.solution import Trajectory
from vgps.writers.tum import write_tum


def test_tied_frames_lie_where_the_truth_says(tmp_path: Path) -> None:
    t_s = np.arange(5) / 10
    poses = make_poses(np.column_stack([3.0 * np.arange(5), np.zeros(5), np.zeros(5)]), np.eye(3))
    write_tum(Trajectory(t_s, poses), tmp_path / "truth.tum")
    tied = replace(make_solution(t_s, poses), loops=np.array([[4, 0], [2, 1]]))
    np.testing.assert_allclose(distances_m(tied, tmp_path), [12.0, 3.0], atol=1e-6)
