import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_run import WallRun, make_wall_run

from vgps.cli import main
from vgps.errors import LandmarkDatabaseError, RecordingError
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.info import build_from_runs, database_info
from vgps.model import GeodeticPoint
from vgps.writers.run_folder import write_run


@pytest.fixture(scope="module")
def wall(tmp_path_factory: pytest.TempPathFactory) -> WallRun:
    return make_wall_run(tmp_path_factory.mktemp("wall"))


def vgps(monkeypatch, capsys, *words) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["vgps", "landmarks", *map(str, words)])
    monkeypatch.setenv("COLUMNS", "200")
    code = 0
    try:
        main()
    except SystemExit as stop:
        code = int(stop.code or 0)
    shown = capsys.readouterr()
    return code, shown.out, shown.err


def test_build_and_info_say_the_same(monkeypatch, capsys, wall: WallRun, tmp_path: Path) -> None:
    out = tmp_path / "wall.vgps"
    words = ("build", wall.run, "--out", out, "--frames", "even", "--max-views", 3)
    code, told, _ = vgps(monkeypatch, capsys, *words)
    assert code == 0
    assert vgps(monkeypatch, capsys, "info", out) == (0, told, "")
    found = database_info(out)
    for number in (found.landmarks, found.views, found.descriptors, found.sha256):
        assert str(number) in told
    assert f"even frames, {found.landmarks} landmarks, max_views 3" in told
    assert found.landmarks < found.views <= 3 * found.landmarks
    with LandmarkDatabase.open(out) as database:
        points = database.all_views().world_p_landmark
        assert found.keyframes == len(database.keyframes()) == 3
    np.testing.assert_array_equal(found.extent_m, [points.min(axis=0), points.max(axis=0)])
    assert found.file_bytes == out.stat().st_size


def test_two_runs_of_different_origins_meet_in_one_world(wall: WallRun, tmp_path: Path) -> None:
    moved = replace(wall.solution, world_origin=GeodeticPoint(49.011, 8.4166, 163.0))
    write_run(moved, tmp_path / "other")
    both = build_from_runs([wall.run, tmp_path / "other"])
    half = len(both.views) // 2
    apart = both.views.world_p_landmark[half:] - both.views.world_p_landmark[:half]
    # a ten-thousandth of a degree of longitude at 49 degrees north, to the east
    np.testing.assert_allclose(apart, np.tile([7.32, 0, 0], (half, 1)), atol=0.02)
    assert len(both.sources) == 2


def test_a_recording_that_moved_is_named(wall: WallRun, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(wall.recording, elsewhere)
    gone = tmp_path / "gone"
    write_run(replace(wall.solution, recording=tmp_path / "nowhere"), gone)
    with pytest.raises(RecordingError, match="nowhere: no such recording"):
        build_from_runs([gone])
    found = build_from_runs([gone], recording=elsewhere)
    assert found.sources[0].recording == str(elsewhere)
    with pytest.raises(LandmarkDatabaseError, match="one recording for 2 runs"):
        build_from_runs([gone, gone], recording=elsewhere)
    unknown = tmp_path / "unknown"
    write_run(replace(wall.solution, recording=None), unknown)
    with pytest.raises(LandmarkDatabaseError, match="does not say which recording"):
        build_from_runs([unknown])


def test_mistakes_are_one_line(monkeypatch, capsys, wall: WallRun, tmp_path: Path) -> None:
    out = tmp_path / "x.vgps"
    for words, told in (
        (("build", "--out", out), "no run is given"),
        (("build", tmp_path / "no", "--out", out), "is no folder"),
        (("build", wall.run, "--out", tmp_path), "is a folder"),
        (("build", wall.run, "--out", out, "--levels", 9), "less than or equal to 6"),
        (("info", tmp_path / "no.vgps"), "no such file"),
        (("info", wall.run / "poses.tum"), "is no SQLite database"),
    ):
        code, out_text, err = vgps(monkeypatch, capsys, *words)
        assert (code, out_text, err.count("\n")) == (2, "", 1), words
        assert told in err
    assert not out.exists()
