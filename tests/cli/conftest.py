"""Verbs run in this process."""

import sys
from collections.abc import Callable

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
