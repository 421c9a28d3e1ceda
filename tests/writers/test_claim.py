"""One process at a time writes an output."""

import subprocess
import sys
from pathlib import Path

import pytest
from claims import HOLDER

from vgps.errors import RunFolderError
from vgps.writers.atomic import new_file
from vgps.writers.claim import claimed


@pytest.fixture
def holder(tmp_path: Path):
    """Another process that writes ``tmp_path / "run"`` until its standard input ends."""
    words = [sys.executable, "-c", HOLDER, str(tmp_path / "run")]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_the_second_process_is_refused_and_told_of_the_first(holder, tmp_path: Path) -> None:
    with (
        pytest.raises(RunFolderError, match=rf"another vgps \(process {holder.pid}\)"),
        claimed(tmp_path / "run"),
    ):
        pass
    with claimed(tmp_path / "other"):
        pass


def test_a_killed_process_holds_nothing(holder, tmp_path: Path) -> None:
    holder.kill()
    holder.wait()
    with claimed(tmp_path / "run"):
        assert (tmp_path / ".run.lock").exists()
    assert list(tmp_path.iterdir()) == []


def test_a_process_may_claim_again_what_it_holds(tmp_path: Path) -> None:
    with claimed(tmp_path / "run"):
        with claimed(tmp_path / "run"), new_file(tmp_path / "run") as scratch:
            scratch.write_text("x")
        assert (tmp_path / ".run.lock").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_what_a_killed_process_left_behind_is_removed(tmp_path: Path) -> None:
    (tmp_path / ".run.new-abc" / "run").mkdir(parents=True)
    (tmp_path / ".run.new-def" / "earlier").mkdir(parents=True)
    (tmp_path / ".run.new-def" / "earlier" / "solution.json").write_text("{}")
    with claimed(tmp_path / "run"):
        pass
    assert (tmp_path / "run" / "solution.json").exists()  # it was being replaced
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
