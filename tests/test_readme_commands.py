"""Every command and example of the documents runs as it is written, on one desk, in the documents' order."""

import re
import shlex
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from recordings import SMALL

import vgps
from vgps.cli import main
from vgps.model import GeodeticPoint
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import GpsConfig, simulate

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = (
    "README.md",
    "vgps/config/README.md",
    "vgps/simulate/README.md",
    "vgps/evaluation/README.md",
    "vgps/places/README.md",
    "vgps/writers/README.md",
    "vgps/survey/README.md",
    "vgps/landmarks/README.md",
    "vgps/localization/README.md",
    "vgps/crs/README.md",
    "vgps/online/README.md",
    "vgps/solver/README.md",
    "factors/README.md",
)
# what stands for a user's own
PLACEHOLDERS = {
    "RECORDING": "walk",
    "recording": "walk",
    "video.mp4": "walk/video.mp4",
    "RUN": "run",
    "RUN...": "run",
    "T.tum": "walk/truth.tum",
    "F.html": "run.html",
    "LOG...": "stationary.nmea",
    "S.yaml": "receiver.yaml",
    "DB": "street.vgps",
    "FORMAT": "tum",
    "PATH": "poses.tum",
}
# runs that no later command may take for that of vgps smooth
OUT = {"online": "live", "track": "tracked"}
# by how they begin: run by tests of their own, since they are long, or need a screen or a camera
ELSEWHERE = {
    "vgps demo": "tests/cli/test_demo.py",
    "vgps compare": "tests/compare/test_methods.py",
    "vgps join": "tests/pipeline/test_join.py",
    "vgps inspect": "tests/cli/test_inspect.py",
    "vgps calibrate-camera": "tests/cli/test_calibrate_camera.py",
    "vgps calibrate-gyro": "tests/gyro_calibration/test_real_recordings.py",
    "vgps calibrate-imu": "tests/gyro_calibration/test_imu.py",
    "vgps simulate": "tests/simulate/test_recording.py",
    "vgps online --video": "tests/online/test_session.py",
    "vgps smooth GX010042.MP4": "tests/readers/test_readme_commands.py",
    "vgps VERB": "tests/cli/test_app.py",
}


def commands(text):
    """Return the commands of a document: whole ones, not mentions of a verb; comments are left out."""
    found = re.findall(
        r"^```(?:sh)?\n(.*?)^```$|`(vgps [a-z-]+ (?!--)[^`]+)`", text, re.MULTILINE | re.DOTALL
    )
    lines = [line for block, inline in found for line in (block or inline).splitlines()]
    shell = re.compile(r"(vgps|mkdir|printf) ")
    return [line.split("  #")[0].strip() for line in lines if shell.match(line)]


def examples(text):
    return re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def elsewhere(line):
    return next((file for begin, file in ELSEWHERE.items() if line.startswith(begin)), None)


@pytest.fixture
def desk(tmp_path, monkeypatch, data_dir):
    """What the README says a user has: a video and a log of it; the beginnings of real receivers' logs."""
    walk = replace(
        SMALL,
        width=1280,
        height=720,
        focal_px=933.0,
        fps=6,
        max_samples=1,
        speed=((0.0, 1.5), (2.0, 1.5)),
        gps=GpsConfig(fix_share=0.5, interval_s=0.5),
        camera_p_antenna=(0.0, -0.3, 0.0),
        start_utc=datetime(2026, 5, 1, 9, 30, 12, 500000, tzinfo=UTC),
        world_origin=GeodeticPoint(49.011, 8.4165, 160.0),
    )
    simulate(tmp_path / "made", walk, seed=3)
    (tmp_path / "made/video.mp4").rename(tmp_path / "GX010042.mp4")
    (tmp_path / "made/gps.nmea").rename(tmp_path / "rover.nmea")
    for log in ("survey/stationary.nmea", "rtk_drive/solution.pos", "rtk_drive/reference.pos"):
        lines = (data_dir / log).read_text().splitlines(keepends=True)
        (tmp_path / Path(log).name).write_text("".join(lines[:600]))
    (tmp_path / "recording").symlink_to("walk")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(line, monkeypatch, capsys):
    """Run a command as a shell does; return what it printed."""
    for part in line.split(" && "):
        words, into = shlex.split(part), None
        if len(words) > 2 and words[-2] == ">":
            *words, _, into = words
        words = [PLACEHOLDERS.get(word, word) for word in words]
        if words[1] in OUT:
            words[words.index("--out") + 1] = OUT[words[1]]
        if words[0] == "mkdir":
            Path(words[1]).mkdir()
            for made in ("truth.tum", "gyro.csv"):  # what the README's user does not need
                (Path("made") / made).rename(Path(words[1]) / made)
        elif words[0] == "cp":
            Path(words[2]).write_bytes(Path(words[1]).read_bytes())
        elif words[0] == "printf":
            Path(into).write_text(words[1].replace("\\n", "\n"))
        else:
            monkeypatch.setattr(sys, "argv", words)
            try:
                main()
            except SystemExit as stop:
                assert not stop.code, f"{line}: {capsys.readouterr().err}"
    return capsys.readouterr().out


@pytest.mark.slow
def test_every_command_and_example_runs(desk, monkeypatch, capsys):
    done = set()
    for name in DOCUMENTS:
        text = (ROOT / name).read_text(encoding="utf-8")
        for line in commands(text):
            same = tuple(PLACEHOLDERS.get(word, word) for word in line.split())
            if elsewhere(line) is None and same not in done:
                run(line, monkeypatch, capsys)
                done.add(same)
        for example in examples(text):
            alone = name == "README.md"  # its example takes nothing for granted
            exec(compile(example, name, "exec"), {} if alone else known(desk))
            if alone:
                shape, reason = capsys.readouterr().out.splitlines()
                poses = read_trajectory(desk / "run/poses.tum").world_T_camera
                assert shape == str(poses.shape) and reason.startswith("used: ")
    assert {"run.html", "street.vgps", "receiver.yaml", "scene", "run.gpkg", "points.laz"} <= {
        file.name for file in desk.iterdir()
    }


def known(desk):
    """What an example takes for granted."""
    recording = vgps.open_recording(desk / "walk")
    return {
        "vgps": vgps, "camera": recording.camera, "world_T_camera": np.eye(4),
    }  # fmt: skip


def test_no_document_with_commands_is_left_out():
    run_here = {ROOT / name for name in DOCUMENTS}
    own = {"vgps/readers/README.md": "tests/readers/test_readme_commands.py"}
    own |= {"vgps/cluster/README.md": "tests/cluster/test_readme_commands.py"}
    own |= {"vgps/smoothing/README.md": "tests/smoothing/stage_d/test_run_graph.py"}
    documents = {file for room in ("vgps", "factors") for file in (ROOT / room).rglob("README.md")}
    for file in sorted(documents - run_here):
        text = file.read_text(encoding="utf-8")
        lines = [line for line in commands(text) if elsewhere(line) is None]
        assert not (lines or examples(text)) or str(file.relative_to(ROOT)) in own, (file, lines)
    assert all((ROOT / test).is_file() for test in (*ELSEWHERE.values(), *own.values()))
