"""Verbs run in this process."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vgps.cli import main

Verb = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vgps_verb(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Verb:
    """Run a verb; return its exit code, standard output and standard error."""

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["vgps", *map(str, words)])
        code = 0
        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        return code, *capsys.readouterr()

    return run


@pytest.fixture(scope="session")
def smoothed(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run folder of the small recording, made by the command."""
    out = tmp_path_factory.mktemp("cli") / "run"
    words = [sys.executable, "-m", "vgps", "smooth", str(recording), "--out", str(out)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out
