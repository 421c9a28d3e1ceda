"""``vgps join`` as a user runs it; the adjustment itself is in tests/pipeline/test_join.py."""

import shutil
from pathlib import Path

import pytest


def test_a_mistake_is_one_line(vgps_verb, tmp_path: Path) -> None:
    for words in (
        ["join", tmp_path / "a", "--out", tmp_path / "out"],
        ["join", "a", "b", "--out", tmp_path / "o"],
    ):
        code, out, err = vgps_verb(*words)
        assert (code, out) == (2, "") and err.startswith("vgps: ") and err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_run_joined_with_itself_keeps_its_poses(vgps_verb, smoothed: Path, tmp_path: Path) -> None:
    shutil.copytree(smoothed, tmp_path / "again")
    code, out, err = vgps_verb("join", smoothed, tmp_path / "again", "--out", tmp_path / "out")
    assert code == 0, err
    assert "frames of again see places of run" in out and "frames of 2 runs in one world" in out
    assert (tmp_path / "out/again/poses.tum").is_file() and (tmp_path / "out/points.ply").is_file()
