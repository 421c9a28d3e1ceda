"""The accuracy of a recording's logs, as rows of a results file."""

import json
import sys

import pytest

from scripts.benchmarks import accuracy


@pytest.mark.slow
def test_each_log_and_video_has_a_row(brief, tmp_path, monkeypatch, capsys):
    found = tmp_path / "accuracy.json"
    words = [str(brief), "--logs", "gps.nmea", "--reencode", "30", "--late", "0.3", "--json", str(found)]
    monkeypatch.setattr(sys, "argv", ["accuracy", *words])
    accuracy.main()
    rows = json.loads(found.read_text(encoding="utf-8"))["rows"]
    for row in rows:
        assert row["log"] == "gps" and row["seed"] == 0 and row["frames"] == 45 and row["rejected"] == 0
        assert 0.0 < row["mean_m"] < row["max_m"]
        assert (row["max_m"] < 0.15) == (row["late_s"] == 0.0)  # every fix is an RTK-fix, the walk too steady
    assert [row["video"] for row in rows] == ["as it is", "as it is", "crf 30", "crf 30"]
    assert [row["late_s"] for row in rows] == [0.0, 0.3, 0.0, 0.3]
    assert rows[0]["mean_m"] != rows[2]["mean_m"]
    assert capsys.readouterr().out.splitlines()[-1].startswith("| crf 30 | gps | 0.300 | 0.000 | 0 | 45 | ")
