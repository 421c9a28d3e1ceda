"""Videos that play at other speeds, as rows of a results file."""

import json
import sys

import pytest

from scripts.experiments import video_speeds

pytestmark = pytest.mark.slow


def test_each_speed_has_a_row(brief, tmp_path, monkeypatch, capsys):
    found = tmp_path / "speeds.json"
    given = [str(brief), "--logs", "gps.nmea", "--speeds", "1.0", "--json", str(found)]
    monkeypatch.setattr(sys, "argv", ["video_speeds", *given])
    video_speeds.main()
    (row,) = json.loads(found.read_text(encoding="utf-8"))["rows"]
    assert row["log"] == "gps" and row["speed"] == row["speed_found"] == 1.0
    assert 0.0 < row["mean_m"] < row["max_m"] < 0.15  # every fix is an RTK-fix
    assert capsys.readouterr().out.splitlines()[-1].startswith("| gps | 1.000 | 1.000 | ")
