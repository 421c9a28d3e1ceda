import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from vgps.cli.app import print_note


@pytest.fixture(scope="module")
def smoothed(recording, tmp_path_factory):
    """A run made as a user makes it."""
    out = tmp_path_factory.mktemp("cli") / "run"
    words = [sys.executable, "-m", "vgps", "smooth", str(recording), "--out", str(out)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


def test_smooth_writes_a_whole_run(smoothed):
    names = {
        "poses.tum",
        "poses.csv",
        "gps.csv",
        "points.ply",
        "measurements.npz",
        "config.yaml",
        "solution.json",
    }
    assert names <= {file.name for file in smoothed.iterdir()}
    assert len((smoothed / "poses.tum").read_text().splitlines()) >= 90


def test_evaluate(smoothed, recording, vgps_verb):
    truth = recording / "truth.tum"
    code, out, _ = vgps_verb("evaluate", smoothed, "--truth", truth, "--json")
    assert code == 0
    assert json.loads(out)["camera_position_m"]["mean"] < 0.1
    code, out, _ = vgps_verb("evaluate", smoothed, "--truth", truth)
    assert code == 0 and "camera position [m]" in out


@pytest.mark.parametrize("to", ["tum", "ply", "kitti", "nerfstudio", "geojson", "kml", "gpx"])
def test_export(smoothed, tmp_path, vgps_verb, to):
    code, _, _ = vgps_verb("export", smoothed, "--to", to, "--out", tmp_path / f"x.{to}")
    assert code == 0 and (tmp_path / f"x.{to}").stat().st_size > 1000


@pytest.mark.slow
def test_what_stands_in_brackets_in_a_path_is_no_markup(smoothed, tmp_path, vgps_verb):
    """Nor are names between colons emoji."""
    out = tmp_path / "[bold]a[/bold] :car:" / "x[/red].tum"
    code, told, _ = vgps_verb("export", smoothed, "--to", "tum", "--out", out)
    assert code == 0 and told == f"wrote {out}\n"


def test_a_note_is_told_as_it_is(capsys):
    print_note("[red]run[/blue] :car: 1")
    assert capsys.readouterr().out == "note: [red]run[/blue] :car: 1\n"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--plot", "p.xyz"], r"p\.xyz: cannot plot to \.xyz; expected \.png, "),
        (["--plot", "s.yaml"], r"s\.yaml: is the name of both the survey and its plot"),
        (["--plot", "folder.png"], r"folder\.png: is a folder"),
    ],
)
def test_a_plot_that_cannot_be_written_is_refused_before_the_work(
    tmp_path, monkeypatch, vgps_verb, words, told
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.png").mkdir()
    code, _, err = vgps_verb("survey", "no.log", "--out", "s.yaml", *words)
    assert code == 2 and err.count("\n") == 1 and re.search(told, err)
    assert not (tmp_path / "s.yaml").exists()


@pytest.mark.slow
def test_demo_ends_with_its_error(tmp_path):
    words = [sys.executable, "-m", "vgps", "demo", "--out", str(tmp_path / "demo")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "camera position [m]" in done.stdout
    assert (tmp_path / "demo" / "run" / "solution.json").is_file()
    assert (tmp_path / "demo" / "report.html").is_file()


def broken(folder: Path, name: str, how) -> Path:
    path = folder / name
    path.write_bytes(how(path.read_bytes()))
    return folder


BAD = {
    "no video": (lambda f: (f / "video.mp4").unlink(), "no video"),
    "not a video": (lambda f: broken(f, "video.mp4", lambda _: b"nonsense"), "cannot be read as a video"),
    "another day": (
        lambda f: broken(f, "rig.yaml", lambda b: b.replace(b"video_start_utc: 20", b"video_start_utc: 19")),
        "no fix during the video",
    ),
    "no known class": (
        lambda f: (f / "gps.nmea").unlink() or (f / "gps.csv").write_text(
            "t_s,latitude_deg,longitude_deg,height_m,class\n1,49,8,100,odd\n2,49,8,100,odd\n"
        ),
        "gps.csv",
    ),
    "two fixes": (
        lambda f: broken(f, "gps.nmea", lambda b: b"\n".join(b.splitlines()[:6])), "2 usable fixes"
    ),
    "not a number": (
        lambda f: (f / "gps.nmea").unlink() or (f / "gps.csv").write_text(
            "t_s,latitude_deg,longitude_deg,height_m,class\n1,nan,8,100,rtk_fix\n"
        ),
        "no fix with a position",
    ),
    "empty log": (lambda f: broken(f, "gps.nmea", lambda _: b""), "the file is empty"),
    "cut sentence": (lambda f: broken(f, "gps.nmea", lambda b: b[:40]), "gps.nmea"),
    "another size": (
        lambda f: broken(f, "camera.yaml", lambda b: b.replace(b"width: 320", b"width: 640")), "640 x 240"
    ),
    "unknown camera key": (lambda f: broken(f, "camera.yaml", lambda b: b + b"zoom: 2\n"), "zoom"),
    "no camera": (lambda f: (f / "camera.yaml").unlink(), "camera.yaml"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line(recording, tmp_path, vgps_verb, case):
    damage, words = BAD[case]
    folder = tmp_path / "bad"
    shutil.copytree(recording, folder)
    damage(folder)
    code, _, err = vgps_verb("smooth", folder, "--out", tmp_path / "run")
    assert code == 2
    assert words in err and err.startswith("vgps: ") and len(err.strip().splitlines()) == 1
    assert sorted(file.name for file in tmp_path.iterdir()) == ["bad"]


@pytest.mark.parametrize(
    ("config", "words"),
    [
        ("tracking: {max_feature: 3}", "key tracking.max_feature: unknown key"),
        ("tracking: {max_features: -3}", "tracking.max_features"),
        ("seed: [", "not YAML"),
        ("seed: -1", "key seed"),
    ],
)
def test_a_bad_configuration_is_one_line(recording, tmp_path, vgps_verb, config, words):
    file = tmp_path / "c.yaml"
    file.write_text(config)
    code, _, err = vgps_verb("smooth", recording, "--config", file, "--out", tmp_path / "run")
    assert code == 2 and words in err and len(err.strip().splitlines()) == 1


def test_a_wrong_verb_and_a_missing_recording(tmp_path, vgps_verb):
    code, _, err = vgps_verb("smoth")
    assert code == 2 and "smooth" in err and len(err.strip().splitlines()) == 1
    code, _, err = vgps_verb("smooth", tmp_path / "nowhere", "--out", tmp_path / "run")
    assert code == 2 and "no such recording" in err


def test_nothing_else_is_overwritten(recording, tmp_path, vgps_verb):
    precious = tmp_path / "thesis"
    precious.mkdir()
    (precious / "chapter1.txt").write_text("words")
    code, _, err = vgps_verb("smooth", recording, "--out", precious)
    assert code == 2 and "thesis" in err
    assert (precious / "chapter1.txt").read_text() == "words"


def test_survey(data_dir, tmp_path, vgps_verb):
    log, out = data_dir / "survey/stationary.nmea", tmp_path / "receiver.yaml"
    code, text, _ = vgps_verb("survey", log, "--out", out)
    assert code == 0 and "rtk_float" in text and "survey longer" in text
    assert out.is_file() and out.with_suffix(".png").is_file()
    code, _, err = vgps_verb("survey", log, "--out", out, "--truth", "1,2")
    assert code == 2 and "LATITUDE,LONGITUDE,HEIGHT" in err and err.count("\n") == 1
