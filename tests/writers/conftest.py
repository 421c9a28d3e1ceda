"""The runs that writers' tests write."""

from pathlib import Path

import pytest
from distinct_solution import distinct_values
from solutions import exact_run

from vgps.solution import Solution
from vgps.writers.run_folder import write_run


@pytest.fixture
def solution() -> Solution:
    return distinct_values()


@pytest.fixture
def run(solution: Solution, tmp_path: Path) -> Path:
    """The run folder of the solution."""
    write_run(solution, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture(scope="session")
def true_run(recording: Path) -> Solution:
    """The small simulated recording with its true poses, as a run that found them exactly."""
    return exact_run(recording)
