"""``vgps demo`` as a user runs it, on a shorter walk in smaller pictures."""

import pytest
from recordings import BRIEF


@pytest.mark.slow
def test_demo_prints_its_errors_and_writes_a_report(tmp_path, vgps_verb, monkeypatch):
    monkeypatch.setattr("vgps.simulate.scene.SCENES", {"demo": BRIEF})
    code, printed, error = vgps_verb("demo", "--out", tmp_path / "demo")
    assert code == 0, error
    assert "camera position [m]" in printed
    assert (tmp_path / "demo" / "run" / "solution.json").is_file()
    assert (tmp_path / "demo" / "report.html").is_file()
