"""``vgps smooth`` as a user runs it, and what it makes of bad input."""

import shutil
from pathlib import Path

import pytest
from solutions import short_drive

from vgps.cli.smooth import print_summary


@pytest.mark.slow
def test_smooth_writes_a_complete_run(smoothed):
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
    "one fix": (
        lambda f: broken(f, "gps.nmea", lambda b: b"\n".join(b.splitlines()[:3])), "during the video: 1"
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
}  # fmt: skip


@pytest.mark.slow
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


@pytest.mark.slow
def test_two_fixes_give_poses_and_a_warning(brief, tmp_path, vgps_verb):
    folder = tmp_path / "few"
    shutil.copytree(brief, folder)
    broken(folder, "gps.nmea", lambda b: b"\n".join(b.splitlines()[:6]))
    code, out, err = vgps_verb("smooth", folder, "--out", tmp_path / "run")
    assert code == 0, err
    assert "only 2 fixes tie the path to the world" in out + err
    assert (tmp_path / "run" / "poses.csv").is_file()


def test_what_was_left_out_of_the_pictures_is_printed(capsys):
    print_summary(short_drive(), Path("run"))
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" (")[0] for line in lines if line.startswith("part of the picture")] == [
        "part of the picture does not move with the scene",
        "part of the picture moves on its own",
    ]
