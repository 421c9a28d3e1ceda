"""``vgps survey`` as a user runs it."""

import re

import numpy as np
import pytest
import yaml
from csv_logs import csv_log


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--plot", "p.xyz"], r"p\.xyz: cannot plot to \.xyz; expected \.png, "),
        (["--plot", "s.yaml"], r"s\.yaml: is the name of both the survey and its plot"),
        (["--plot", "folder.png"], r"folder\.png: is a folder"),
    ],
)
def test_a_plot_that_cannot_be_written_is_refused_before_the_work(
    tmp_path, monkeypatch, vgps_verb, words, message
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.png").mkdir()
    code, _, err = vgps_verb("survey", "no.log", "--out", "s.yaml", *words)
    assert code == 2 and err.count("\n") == 1 and re.search(message, err)
    assert not (tmp_path / "s.yaml").exists()


@pytest.mark.slow
def test_a_survey_writes_its_file_and_plot_and_prints_tables_and_warnings(data_dir, tmp_path, vgps_verb):
    log, out = data_dir / "survey/stationary.nmea", tmp_path / "receiver.yaml"
    code, text, _ = vgps_verb("survey", log, "--out", out)
    assert code == 0 and "rtk_float" in text and "survey longer" in text
    assert out.is_file() and out.with_suffix(".png").is_file()


def test_half_a_truth_is_refused(tmp_path, vgps_verb):
    code, _, err = vgps_verb("survey", "no.log", "--out", tmp_path / "s.yaml", "--truth", "1,2")
    assert code == 2 and "LATITUDE,LONGITUDE,HEIGHT" in err and err.count("\n") == 1


@pytest.mark.slow
def test_survey_of_a_drive_with_a_reference(tmp_path, vgps_verb):
    rng = np.random.default_rng(0)
    drive = np.arange(80)[:, None] * [10.0, 0.0, 0.0]
    better = csv_log(tmp_path / "better.csv", drive, ["rtk_fix"] * 80)
    error = np.cumsum(rng.normal(0, 0.05, (80, 3)), axis=0)
    log, out = csv_log(tmp_path / "log.csv", drive + error, ["rtk_float"] * 80), tmp_path / "receiver.yaml"
    code, text, _ = vgps_verb("survey", log, "--reference", better, "--out", out)
    assert code == 0 and "Changes of the error" in text
    found = yaml.safe_load(out.read_text())
    assert found["survey"]["reference"] == str(better) and "truth" not in found["survey"]
    assert found["rtk_float"]["walk_m"] == pytest.approx(0.05, rel=0.3)
    assert {"r_m", "h_m", "noise_m", "tail", "vertical", "correlation_s"} <= set(found["rtk_float"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--reference", "log.csv"], r"log\.csv: the same as the reference log\.csv"),
        (["--reference", "gone.pos"], r"gone\.pos: "),
        (["--reference", "log.csv", "--truth", "35,139,40"], "--truth and --reference are both given"),
    ],
)
def test_a_reference_that_is_none_is_refused_and_nothing_is_written(
    tmp_path, monkeypatch, vgps_verb, words, message
):
    monkeypatch.chdir(tmp_path)
    csv_log(tmp_path / "log.csv", np.zeros((30, 3)), ["rtk_fix"] * 30)
    code, _, err = vgps_verb("survey", "log.csv", "--out", "s.yaml", *words)
    assert code == 2 and err.count("\n") == 1 and re.search(message, err)
    assert [file.name for file in tmp_path.iterdir()] == ["log.csv"]
