import subprocess
import sys

import pytest

from vgps.config import Config, read_config
from vgps.config.reference import reference_text


def test_config_prints_the_reference(vgps_verb):
    assert vgps_verb("config") == (0, reference_text(), "")


def test_the_printed_defaults_are_a_file_for_config(vgps_verb, tmp_path):
    code, text, error = vgps_verb("config", "--defaults")
    assert (code, error) == (0, "")
    file = tmp_path / "defaults.yaml"
    file.write_text(text)
    assert read_config(file) == Config()


@pytest.mark.parametrize(
    "verb", ["smooth", "calibrate-gyro", "compare", "online", "track", "landmarks build"]
)
def test_a_setting_of_any_part_is_refused_by_every_verb_in_one_line(vgps_verb, tmp_path, verb):
    file = tmp_path / "c.yaml"
    file.write_text("localization: {min_inlier_share: 30}\n")
    extra = {"compare": ["--truth", "t"], "track": ["--landmarks", "d"]}.get(verb, [])
    code, out, error = vgps_verb(*verb.split(), tmp_path, *extra, "--out", tmp_path / "out", "--config", file)
    assert (code, out) == (2, "")
    assert error == (f"vgps: {file}, key localization.min_inlier_share: found 30; expected less than 1\n")


@pytest.mark.slow
def test_an_old_name_is_one_line_on_standard_error_that_gives_the_present_one(tmp_path):
    # in a process of its own: pytest keeps log messages to itself
    file = tmp_path / "c.yaml"
    file.write_text("judge: {tail_size: 3}\n")
    words = ["survey", tmp_path / "none.nmea", "--out", tmp_path / "s.yaml", "--config", file]
    done = subprocess.run(
        [sys.executable, "-m", "vgps", *map(str, words)], capture_output=True, text=True, check=False
    )
    warning, error = done.stderr.splitlines()
    assert warning == f"{file}: setting judge is now called outliers"
    assert error.startswith("vgps: ") and "none.nmea" in error
    assert (done.returncode, done.stdout) == (2, "")
