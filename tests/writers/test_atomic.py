"""Run folders appear whole or not at all."""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import pytest
from run_files import assert_same, bytes_of, rows

from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run
from vgps.solution import Solution
from vgps.writers import run_folder
from vgps.writers.run_folder import check_writable, write_run


def test_an_earlier_run_is_replaced_and_what_lies_beside_it_stays(solution: Solution, tmp_path: Path) -> None:
    out = tmp_path / "run"
    write_run(solution, out)
    (out / "notes.txt").write_text("mine")
    (out / "poses.csv").write_text("stale")
    write_run(dataclasses.replace(solution, warnings=("second",)), out)
    assert read_run(out).warnings == ("second",)
    assert rows(out / "poses.csv")[0]["frame"] == "0"
    assert (out / "notes.txt").read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_run_behind_a_link_is_replaced_where_it_lies(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "run")
    write_run(solution, tmp_path / "link")
    write_run(solution, tmp_path / "link")
    assert (tmp_path / "link").is_symlink()
    assert_same(read_run(tmp_path / "run"), solution)


def test_an_empty_folder_is_used(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    write_run(solution, tmp_path / "run")
    assert_same(read_run(tmp_path / "run"), solution)


def test_a_folder_of_other_things_is_left_alone(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "holiday.jpg").write_bytes(b"x")
    for attempt in (lambda: check_writable(tmp_path), lambda: write_run(solution, tmp_path)):
        with pytest.raises(RunFolderError, match=r"holds other files and no solution\.json"):
            attempt()
    assert [path.name for path in tmp_path.iterdir()] == ["holiday.jpg"]


def test_an_existing_file_is_refused(solution: Solution, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(RunFolderError, match="is a file; expected a folder"):
        check_writable(tmp_path / "file")
    with pytest.raises(RunFolderError, match="file is a file"):
        check_writable(tmp_path / "file/deeper/run")
    with pytest.raises(RunFolderError, match="mount point"):
        check_writable(Path("/"))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_refused(tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(RunFolderError, match="cannot be written"):
        check_writable(tmp_path / "locked/run")


def test_checking_changes_nothing(tmp_path: Path) -> None:
    check_writable(tmp_path / "a/b/run")
    assert list(tmp_path.iterdir()) == []


def test_a_failure_while_writing_leaves_the_earlier_run(
    solution: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_run(solution, tmp_path / "run")
    before = bytes_of(tmp_path / "run")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run_folder, "write_measurements", full)
    with pytest.raises(RunFolderError, match="No space left on device"):
        write_run(solution, tmp_path / "run")
    assert bytes_of(tmp_path / "run") == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


_KILLED = """
import os, pickle, sys
from pathlib import Path
from vgps.writers import run_folder
run_folder.write_measurements = lambda *_: os.kill(os.getpid(), 9)
run_folder.write_run(pickle.loads(sys.stdin.buffer.read()), Path(sys.argv[1]))
"""


@pytest.mark.slow
def test_a_killed_run_leaves_no_file_under_a_final_name(solution: Solution, tmp_path: Path) -> None:
    import pickle

    out = tmp_path / "run"
    done = subprocess.run(
        [sys.executable, "-c", _KILLED, str(out)], input=pickle.dumps(solution), check=False, timeout=60
    )
    assert done.returncode == -9
    assert not out.exists()
    left = {path.name.split("-")[0] for path in tmp_path.iterdir()}
    assert left == {".run.new", ".run.lock"}
    write_run(solution, out)
    assert_same(read_run(out), solution)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
