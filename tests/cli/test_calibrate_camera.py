"""``vgps calibrate-camera`` as a user runs it, and verbs that need the calibration which it writes."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from solutions import exact_run

from vgps.config import Config
from vgps.readers.calibration.camera_file import read_camera


@pytest.fixture
def uncalibrated(recording: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "walk"
    shutil.copytree(recording, folder)
    (folder / "camera.yaml").unlink()
    return folder


def test_the_camera_of_a_video_is_written(recording, uncalibrated, tmp_path, vgps_verb, monkeypatch):
    """How it is found has its tests in tests/pipeline/test_camera_refinement.py; here it is given."""
    run = replace(exact_run(recording), warnings=("a note",))

    def smooth(opened, config, _):
        assert opened.guesses and config == Config().with_refined_camera()
        return run

    monkeypatch.setattr("vgps.pipeline.offline.smooth", smooth)
    code, out, err = vgps_verb("calibrate-camera", uncalibrated, "--out", tmp_path / "camera.yaml")
    assert code == 0 and out.endswith(f"wrote {tmp_path / 'camera.yaml'}\n") and "a note" in out + err
    assert read_camera(tmp_path / "camera.yaml") == run.camera


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("track", "--landmarks", "none.vgps"), ("compare", "--truth", "truth.tum"), ("online",)]
)
def test_other_verbs_ask_for_a_calibration(uncalibrated, tmp_path, vgps_verb, words):
    verb, *options = words
    code, _, err = vgps_verb(verb, uncalibrated, *options, "--out", tmp_path / "out")
    assert code == 2 and len(err.strip().splitlines()) == 1
    assert "no camera.yaml; give a calibration with --camera, such as the camera.yaml of a run" in err
