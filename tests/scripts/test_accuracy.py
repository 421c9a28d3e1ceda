"""The accuracy of a recording's logs, as rows of a results file."""

import json
import sys

from scripts.benchmarks import accuracy


def test_each_log_has_a_row(recording, tmp_path, monkeypatch, capsys):
    found = tmp_path / "accuracy.json"
    words = [str(recording), "--logs", "gps.nmea", "--json", str(found)]
    monkeypatch.setattr(sys, "argv", ["accuracy", *words])
    accuracy.main()
    (row,) = json.loads(found.read_text(encoding="utf-8"))["rows"]
    assert row["log"] == "gps" and row["seed"] == 0 and row["frames"] == 90 and row["rejected"] == 0
    assert 0.0 < row["mean_m"] < row["max_m"] < 0.15  # every fix is an RTK-fix
    assert capsys.readouterr().out.splitlines()[-1].startswith("| gps | 0 | 90 | ")
