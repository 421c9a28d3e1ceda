"""The run that the verbs' tests examine."""

import subprocess
import sys
from pathlib import Path

import pytest
from shared_runs import SharedFolder


@pytest.fixture(scope="session")
def smoothed(recording: Path, shared_folder: SharedFolder) -> Path:
    """The run folder of the small recording, made by the command."""

    def command(out: Path) -> None:
        words = [sys.executable, "-m", "vgps", "smooth", str(recording), "--out", str(out)]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr

    return shared_folder("run", command)
