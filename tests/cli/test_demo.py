"""``vgps demo`` as a user runs it, with a shorter walk in smaller pictures."""

import subprocess
import sys

import pytest

SMALLER = """
from dataclasses import replace
from vgps import demo, simulate
from vgps.cli import main
small = {"width": 360, "height": 240, "focal_px": 310.0, "texture_scale": 0.5}
scene = replace(simulate.SCENES["demo"], speed=((0.0, 1.2), (5.0, 1.2)), **small)
demo.simulate = lambda out, name, seed: simulate.simulate(out, {"demo": scene}[name], seed)
main()
"""


@pytest.mark.slow
def test_demo_prints_its_errors_and_writes_a_report(tmp_path):
    words = [sys.executable, "-c", SMALLER, "demo", "--out", str(tmp_path / "demo")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "camera position [m]" in done.stdout
    assert (tmp_path / "demo" / "run" / "solution.json").is_file()
    assert (tmp_path / "demo" / "report.html").is_file()
