from dataclasses import replace
from types import SimpleNamespace

import pytest

import vgps
from scripts.common.results import read_results
from scripts.experiments import random_scenes
from vgps.simulate import SCENES


def test_a_seed_draws_the_same_again_and_others_something_else():
    cases = [random_scenes.draw(seed) for seed in range(40)]
    assert cases[7] == random_scenes.draw(7)
    assert {case.base for case in cases} == set(random_scenes.BASES)
    assert {name for case in cases for name in case.lacks} == {
        "camera.yaml",
        "lever arm",
        "sigmas",
        "some fixes",
    }
    assert all(case.scene.readout_s < 1.0 / case.scene.fps for case in cases)


@pytest.mark.parametrize("lacks", [frozenset(), frozenset({"camera.yaml", "lever arm"})])
def test_the_user_has_no_more_than_the_case_says(recording, tmp_path, lacks):
    case, drive = replace(random_scenes.draw(0), lacks=lacks), SimpleNamespace(folder=recording)
    log = vgps.open_recording(recording).gps
    found = random_scenes.as_the_user_has_it(case, drive, log, tmp_path / "lacking")
    assert (found.rig.antenna_known, not found.guesses) == ((False, False) if lacks else (True, True))
    assert found.rig.world_origin is not None and found.gps is log and found.gyro is None


@pytest.mark.slow
def test_a_case_is_simulated_and_smoothed_without_what_the_user_lacks(
    data_dir, tmp_path, monkeypatch, capsys
):
    small = replace(SCENES["demo"], fps=10, speed=((0.0, 1.2), (4.0, 1.2)), width=320, height=240)
    small = replace(small, focal_px=310.0, texture_scale=0.25)
    lacks = frozenset({"lever arm", "sigmas", "some fixes"})
    case = random_scenes.Case("demo", small, "survey_fix", 0.2, lacks, 0.4)
    monkeypatch.setattr(random_scenes, "draw", lambda _: case)
    out = tmp_path / "found.json"
    line = ["random_scenes", "--count", "1", "--data", str(data_dir), "--json", str(out)]
    monkeypatch.setattr("sys.argv", line)
    random_scenes.main()
    (row,) = read_results(out)["rows"]
    assert row["lacks"] == "lever arm, sigmas, some fixes" and row["scene"].startswith("demo, 4 s")
    assert 0.0 < row["fixes_mean_m"] < 0.1 < row["mean_m"] < 2.0  # the lever arm is 0.44 m
    assert row["max_m"] >= row["mean_m"] and 0.0 < row["nees"] < 10.0
    assert "| 0 | demo" in capsys.readouterr().out
