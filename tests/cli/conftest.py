"""The run that the verbs' tests examine."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def smoothed(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of the small recording, made by the command."""
    out = tmp_path_factory.mktemp("cli") / "run"
    words = [sys.executable, "-m", "vgps", "smooth", str(recording), "--out", str(out)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out
