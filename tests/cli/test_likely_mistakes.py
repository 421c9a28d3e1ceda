"""The likeliest mistakes of a newcomer: what vgps says of each, as the README of the readers has it."""

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from vgps.readers.recording import open_recording

README = Path(__file__).resolve().parents[2] / "vgps/readers/README.md"
ROWS = re.findall(r"^\| (.+) \| `(vgps [^`]+)` \| `(vgps: .+)` \|$", README.read_text(encoding="utf-8"), re.M)


def nothing():
    pass


def without_start():
    edit("rig.yaml", r"video_start_utc.*\n", "")


def local_time():
    # noon in UTC is nine in the evening in Japan
    edit("rig.yaml", r"video_start_utc.*", "video_start_utc: 2025-06-01 21:00:00")


def other_size():
    edit("camera.yaml", r"width: .*", "width: 4000")
    edit("camera.yaml", r"height: .*", "height: 3000")


def kml():
    Path("walk/gps.nmea").unlink()
    Path("walk/gps.kml").write_text('<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"></kml>')


def without_class():
    csv("t_s,latitude_deg,longitude_deg,height_m", "")


def swapped():
    csv("t_s,longitude_deg,latitude_deg,height_m,fix_class", ",rtk_fix")


def other_files():
    Path("Documents").mkdir()
    Path("Documents/thesis.pdf").write_text("years of work")


def misspelt_key():
    edit("rig.yaml", "camera_p_antenna", "camera_p_antena")


def edit(name, pattern, text):
    file = Path("walk") / name
    file.write_text(re.sub(pattern, text, file.read_text()))


def csv(header, end):
    log = open_recording("walk").gps
    rows = np.column_stack([log.t_s, log.latitude_deg, log.longitude_deg, log.height_m]).tolist()
    Path("walk/gps.nmea").unlink()
    lines = [f"{t:.2f},{lat:.8f},{lon:.8f},{h:.3f}{end}" for t, lat, lon, h in rows]
    Path("walk/gps.csv").write_text("\n".join([header, *lines]))


MISTAKES = {
    "the folder's name misspelt": nothing,
    "no `--out`": nothing,
    "a log in UTC, and nothing says when the video began": without_start,
    "local time as UTC": local_time,
    "a calibration at another size": other_size,
    "a map's KML instead of the log": kml,
    "a CSV without fix classes": without_class,
    "latitude and longitude swapped": swapped,
    "a recording where a run is meant": nothing,
    "a folder of other files as output": other_files,
    "a key misspelt": misspelt_key,
}


def test_the_readme_has_every_mistake():
    assert [mistake for mistake, _, _ in ROWS] == list(MISTAKES)


@pytest.mark.slow
@pytest.mark.parametrize(("mistake", "command", "message"), ROWS, ids=[row[0] for row in ROWS])
def test_a_mistake_is_told_in_one_line(
    mistake, command, message, recording, tmp_path, monkeypatch, vgps_verb
):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(recording, "walk")
    MISTAKES[mistake]()
    before = sorted(tmp_path.rglob("*"))
    code, _, err = vgps_verb(*shlex.split(command)[1:])
    assert code == 2 and err.replace(f"{tmp_path}/", "") == message + "\n"
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.slow
def test_decimal_commas_between_semicolons_are_no_mistake(recording, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(recording, "walk")
    true = open_recording("walk").gps
    csv("t_s,latitude_deg,longitude_deg,height_m,fix_class", ",rtk_fix")
    file = Path("walk/gps.csv")
    file.write_text(file.read_text().replace(",", ";").replace(".", ","))
    found = open_recording("walk").gps
    np.testing.assert_allclose(found.latitude_deg, true.latitude_deg, atol=1e-8)
    np.testing.assert_allclose(found.t_s, true.t_s, atol=0.01)
