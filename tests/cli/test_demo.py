"""``vgps demo`` as a user runs it."""

import subprocess
import sys

import pytest


@pytest.mark.slow
def test_demo_prints_its_errors_and_writes_a_report(tmp_path):
    words = [sys.executable, "-m", "vgps", "demo", "--out", str(tmp_path / "demo")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "camera position [m]" in done.stdout
    assert (tmp_path / "demo" / "run" / "solution.json").is_file()
    assert (tmp_path / "demo" / "report.html").is_file()
