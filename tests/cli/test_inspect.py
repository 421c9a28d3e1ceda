"""``vgps inspect`` as a user runs it, without a display."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest
from reading_back import Logged
from solutions import short_drive

from vgps.solution import Solution
from vgps.writers.run_folder import write_run


@pytest.fixture
def solution() -> Solution:
    return short_drive()


@pytest.fixture(autouse=True)
def no_display(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("COLUMNS", "200")


@pytest.mark.slow
def test_a_run_with_its_video(vgps_verb, solution, recording, tmp_path):
    write_run(replace(solution, recording=recording), tmp_path / "run")
    code, out, _ = vgps_verb("inspect", tmp_path / "run", "--save", tmp_path / "run.rrd")
    assert code == 0
    assert out.strip().endswith(f"wrote {tmp_path / 'run.rrd'}")
    found = Logged(tmp_path / "run.rrd")
    # the run has as many frames as the first six of the recording's video
    assert len(found.rows("/world/camera/image/video", "VideoFrameReference:timestamp")) == 6


@pytest.mark.slow
def test_a_recording_that_no_longer_exists_is_noted(vgps_verb, solution, tmp_path):
    write_run(replace(solution, recording=tmp_path / "gone"), tmp_path / "run")
    code, out, _ = vgps_verb("inspect", tmp_path / "run", "--save", tmp_path / "run.rrd")
    assert code == 0
    [note] = [line for line in out.splitlines() if line.startswith("note:")]
    assert note.startswith(f"note: shown without the video: {tmp_path / 'gone'}")
    assert "/world/camera/image/video" not in Logged(tmp_path / "run.rrd").entities


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no variable that names the display")
def test_without_a_display_one_line_states_the_remedy(vgps_verb, solution, tmp_path):
    write_run(solution, tmp_path / "run")
    code, _, err = vgps_verb("inspect", tmp_path / "run")
    assert code == 2 and err.count("\n") == 1
    assert "no display" in err and "--save F.rrd" in err


def test_a_missing_run_is_one_line(vgps_verb, tmp_path: Path):
    code, _, err = vgps_verb("inspect", tmp_path / "nothing", "--save", tmp_path / "run.rrd")
    assert code == 2 and err.count("\n") == 1 and "nothing" in err
    assert not (tmp_path / "run.rrd").exists()


@pytest.mark.parametrize(
    ("option", "name", "suffix"), [("--save", "a.txt", ".rrd"), ("--screenshot", "a.jpg", ".png")]
)
def test_a_name_with_another_suffix_is_refused_before_the_work(
    vgps_verb, solution, tmp_path, option, name, suffix
):
    write_run(solution, tmp_path / "run")
    code, _, err = vgps_verb("inspect", tmp_path / "run", option, tmp_path / name)
    assert code == 2 and err.endswith(
        f"{name}: has the wrong suffix; expected a name that ends in {suffix}\n"
    )
    assert [file.name for file in tmp_path.iterdir()] == ["run"]
