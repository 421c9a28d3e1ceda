"""`vgps landmarks build` and `vgps landmarks info` as a user calls them."""

from pathlib import Path

import pytest
from synthetic_run import WallRun, make_wall_run

from vgps.landmarks.info import database_info

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wall(tmp_path_factory: pytest.TempPathFactory) -> WallRun:
    return make_wall_run(tmp_path_factory.mktemp("wall"))


def test_build_and_info_print_the_same_summary(monkeypatch, vgps_verb, wall: WallRun, tmp_path: Path) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    out = tmp_path / "wall.vgps"
    words = ("build", wall.run, "--out", out, "--frames", "even", "--max-views", 3)
    code, summary, _ = vgps_verb("landmarks", *words)
    assert code == 0
    assert vgps_verb("landmarks", "info", out) == (0, summary, "")
    info = database_info(out)
    for number in (info.landmarks, info.views, info.descriptors, info.sha256):
        assert str(number) in summary
    assert "schema version" in summary
    assert f"even frames, {info.landmarks} landmarks, max_views 3" in summary
    assert info.landmarks < info.views <= 3 * info.landmarks


def test_mistakes_are_one_line(vgps_verb, wall: WallRun, tmp_path: Path) -> None:
    out = tmp_path / "x.vgps"
    for words, message in (
        (("build", "--out", out), "no run is given"),
        (("build", tmp_path / "no", "--out", out), "folder"),
        (("build", wall.run, "--out", tmp_path), "is a folder"),
        (("build", wall.run, "--out", out, "--levels", 9), "less than or equal to 6"),
        (("info", tmp_path / "no.vgps"), "no such file"),
        (("info", wall.run / "poses.tum"), "is not an SQLite database"),
    ):
        code, out_text, err = vgps_verb("landmarks", *words)
        assert (code, out_text, err.count("\n")) == (2, "", 1), words
        assert message in err
    assert not out.exists()
