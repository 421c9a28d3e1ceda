"""The summary of joined runs."""

from pathlib import Path

import numpy as np

from vgps.readers.run_files import read_summary, run_folders
from vgps.solution import JoinedRuns, Solution
from vgps.writers.joined_runs import write_joined


def test_the_summary_counts_fixes_of_all_runs_and_the_adjustment_once(
    solution: Solution, tmp_path: Path
) -> None:
    joined = JoinedRuns(
        names=("a", "b"),
        solutions=(solution, solution),
        landmarks=solution.landmarks,
        observations=solution.observations,
        ties=np.array([[0, 0], [3, 0]]),
        warnings=("a warning",),
        seconds={"batch": 1.5},
    )
    write_joined(joined, tmp_path / "out")
    summary, one = read_summary(tmp_path / "out"), read_summary(tmp_path / "out/a")
    assert run_folders(tmp_path / "out") == [tmp_path / "out/a", tmp_path / "out/b"]
    counts = {key: summary["counts"][key] for key in ("runs", "frames", "fixes", "landmarks", "submaps")}
    assert counts == {"runs": 2, "frames": 8, "fixes": 4, "landmarks": 3, "submaps": 2}
    assert summary["submaps"] == one["submaps"] and summary["energy"] == one["energy"]
    assert summary["ties"] == [{"run": "b", "earlier": "a", "frames": 3}]
    assert (summary["warnings"], summary["seconds"]) == (["a warning"], {"batch": 1.5})
