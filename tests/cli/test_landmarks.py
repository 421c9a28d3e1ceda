"""`vgps landmarks build` and `vgps landmarks info` as a user calls them."""

import sys
from pathlib import Path

import pytest
from synthetic_run import WallRun, make_wall_run

from vgps.cli import main
from vgps.landmarks.info import database_info


@pytest.fixture(scope="module")
def wall(tmp_path_factory: pytest.TempPathFactory) -> WallRun:
    return make_wall_run(tmp_path_factory.mktemp("wall"))


def vgps(monkeypatch, capsys, *words) -> tuple[int, str, str]:
    """Exit code, standard output and standard error."""
    monkeypatch.setattr(sys, "argv", ["vgps", "landmarks", *map(str, words)])
    monkeypatch.setenv("COLUMNS", "200")
    code = 0
    try:
        main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    shown = capsys.readouterr()
    return code, shown.out, shown.err


def test_build_and_info_print_the_same_summary(monkeypatch, capsys, wall: WallRun, tmp_path: Path) -> None:
    out = tmp_path / "wall.vgps"
    words = ("build", wall.run, "--out", out, "--frames", "even", "--max-views", 3)
    code, summary, _ = vgps(monkeypatch, capsys, *words)
    assert code == 0
    assert vgps(monkeypatch, capsys, "info", out) == (0, summary, "")
    info = database_info(out)
    for number in (info.landmarks, info.views, info.descriptors, info.sha256):
        assert str(number) in summary
    assert "schema version" in summary
    assert f"even frames, {info.landmarks} landmarks, max_views 3" in summary
    assert info.landmarks < info.views <= 3 * info.landmarks


def test_mistakes_are_one_line(monkeypatch, capsys, wall: WallRun, tmp_path: Path) -> None:
    out = tmp_path / "x.vgps"
    for words, message in (
        (("build", "--out", out), "no run is given"),
        (("build", tmp_path / "no", "--out", out), "folder"),
        (("build", wall.run, "--out", tmp_path), "is a folder"),
        (("build", wall.run, "--out", out, "--levels", 9), "less than or equal to 6"),
        (("info", tmp_path / "no.vgps"), "no such file"),
        (("info", wall.run / "poses.tum"), "is not an SQLite database"),
    ):
        code, out_text, err = vgps(monkeypatch, capsys, *words)
        assert (code, out_text, err.count("\n")) == (2, "", 1), words
        assert message in err
    assert not out.exists()
