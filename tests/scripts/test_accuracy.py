"""The accuracy of a recording's logs, as rows of a results file."""

import json
import sys

import numpy as np
import pytest

import vgps
from scripts.benchmarks import accuracy

pytestmark = pytest.mark.slow


@pytest.fixture
def rows_of(brief, tmp_path, monkeypatch):
    def rows_of(*words):
        found = tmp_path / "accuracy.json"
        given = [str(brief), "--logs", "gps.nmea", *words, "--json", str(found)]
        monkeypatch.setattr(sys, "argv", ["accuracy", *given])
        accuracy.main()
        return json.loads(found.read_text(encoding="utf-8"))["rows"]

    return rows_of


def test_each_video_has_a_row(rows_of, capsys):
    rows = rows_of("--reencode", "30")
    for row in rows:
        assert row["log"] == "gps" and row["seed"] == 0 and row["frames"] == 45 and row["rejected"] == 0
        assert 0.0 < row["mean_m"] < row["max_m"] < 0.15  # every fix is an RTK-fix
    assert [row["video"] for row in rows] == ["as it is", "crf 30"]
    assert rows[0]["mean_m"] != rows[1]["mean_m"]
    assert capsys.readouterr().out.splitlines()[-1].startswith("| crf 30 | gps | 0.000 | 0.000 | 0 | 45 | ")


def test_each_clock_and_seed_is_run(rows_of, brief, monkeypatch, capsys):
    runs = []
    monkeypatch.setattr(accuracy, "one_run", lambda *run: runs.append(run) or {"seed": run[1], "frames": 45})
    rows = rows_of("--late", "0.3", "--faster", "0.01", "--seeds", "2")
    t_s = vgps.open_recording(brief).gps.t_s
    clocks = [(0.0, 0.0), (0.3, 0.0), (0.0, 0.01)]
    assert [(row["late_s"], row["clock_rate"]) for row in rows[::2]] == clocks
    assert [row["seed"] for row in rows] == [seed for _, seed in runs] == [0, 1] * 3
    for (opened, _), stamps_s in zip(runs[::2], (t_s, t_s + 0.3, t_s * 1.01), strict=True):
        np.testing.assert_allclose(opened.gps.t_s, stamps_s, atol=1e-3)
    assert capsys.readouterr().out.splitlines()[-3].startswith("| as it is | gps | 0.300 | 0.000 | 1 | 45")
