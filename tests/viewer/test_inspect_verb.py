"""``vgps inspect`` as a user runs it."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from reading_back import Logged

from vgps.cli import main
from vgps.errors import ViewerError
from vgps.solution import Solution
from vgps.viewer import inspect_run
from vgps.writers.run_folder import write_run

Verb = Callable[..., tuple[int, str, str]]


@pytest.fixture
def inspect(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Verb:
    """Runs the verb without a display: exit code, standard output, standard error."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("COLUMNS", "200")

    def run(*words: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["vgps", "inspect", *map(str, words)])
        code = 0
        try:
            main()
        except SystemExit as done:
            code = int(done.code or 0)
        return code, *capsys.readouterr()

    return run


def test_a_run_with_its_video(inspect: Verb, solution: Solution, recording: Path, tmp_path: Path) -> None:
    write_run(replace(solution, recording=recording), tmp_path / "run")
    code, out, _ = inspect(tmp_path / "run", "--save", tmp_path / "run.rrd")
    assert code == 0
    assert out.strip().endswith(f"wrote {tmp_path / 'run.rrd'}")
    found = Logged(tmp_path / "run.rrd")
    # the run has as many frames as the first six of the recording's video
    assert len(found.rows("/world/camera/image/video", "VideoFrameReference:timestamp")) == 6


def test_the_recording_may_be_gone(inspect: Verb, solution: Solution, tmp_path: Path) -> None:
    write_run(replace(solution, recording=tmp_path / "gone"), tmp_path / "run")
    code, out, _ = inspect(tmp_path / "run", "--save", tmp_path / "run.rrd")
    assert code == 0
    notes = [line for line in out.splitlines() if line.startswith("note:")]
    assert len(notes) == 1
    assert notes[0].startswith(f"note: shown without the video: {tmp_path / 'gone'}")
    assert "/world/camera/image/video" not in Logged(tmp_path / "run.rrd").entities


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no variable that names the display")
def test_without_a_display_one_line_says_what_to_do(
    inspect: Verb, solution: Solution, tmp_path: Path
) -> None:
    write_run(solution, tmp_path / "run")
    code, _, told = inspect(tmp_path / "run")
    assert code == 2
    assert told.count("\n") == 1
    assert "no display" in told
    assert "--save F.rrd" in told


def test_no_run_is_one_line(inspect: Verb, tmp_path: Path) -> None:
    code, _, told = inspect(tmp_path / "nothing", "--save", tmp_path / "run.rrd")
    assert code == 2
    assert told.count("\n") == 1
    assert "is no folder" in told
    assert not (tmp_path / "run.rrd").exists()


@pytest.mark.slow
def test_a_picture_is_drawn_without_a_window(solution: Solution, tmp_path: Path) -> None:
    try:
        inspect_run(solution, screenshot=tmp_path / "run.png")
    except ViewerError as error:
        pytest.skip(f"nothing here can draw: {error}")
    with av.open(str(tmp_path / "run.png")) as picture:
        pixels = next(picture.decode(video=0)).to_ndarray(format="rgb24")
    assert pixels.shape[0] >= 800
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 100
