"""``vgps survey`` as a user runs it."""

import re

import pytest


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


def test_survey(data_dir, tmp_path, vgps_verb):
    log, out = data_dir / "survey/stationary.nmea", tmp_path / "receiver.yaml"
    code, text, _ = vgps_verb("survey", log, "--out", out)
    assert code == 0 and "rtk_float" in text and "survey longer" in text
    assert out.is_file() and out.with_suffix(".png").is_file()
    code, _, err = vgps_verb("survey", log, "--out", out, "--truth", "1,2")
    assert code == 2 and "LATITUDE,LONGITUDE,HEIGHT" in err and err.count("\n") == 1
