"""``vgps calibrate-camera`` as a user runs it, and verbs that need the calibration which it writes."""

import shutil
from pathlib import Path

import pytest

from vgps.readers.calibration.camera_file import read_camera

pytestmark = pytest.mark.slow


@pytest.fixture
def uncalibrated(brief: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "walk"
    shutil.copytree(brief, folder)
    (folder / "camera.yaml").unlink()
    return folder


def test_the_camera_of_a_video_is_written(brief, uncalibrated, tmp_path, vgps_verb):
    settings = tmp_path / "settings.yaml"
    settings.write_text("{tracking: {max_features: 200}, camera_calibration: {max_pairs: 8}}\n")
    words = ["calibrate-camera", uncalibrated, "--config", settings, "--out", tmp_path / "camera.yaml"]
    code, out, _ = vgps_verb(*words)
    assert code == 0 and out.endswith(f"wrote {tmp_path / 'camera.yaml'}\n")
    found, true = read_camera(tmp_path / "camera.yaml"), read_camera(brief / "camera.yaml")
    assert found.fx == pytest.approx(true.fx, rel=0.02)


@pytest.mark.parametrize(
    "words", [("track", "--landmarks", "none.vgps"), ("compare", "--truth", "truth.tum"), ("online",)]
)
def test_other_verbs_ask_for_a_calibration(uncalibrated, tmp_path, vgps_verb, words):
    verb, *options = words
    code, _, err = vgps_verb(verb, uncalibrated, *options, "--out", tmp_path / "out")
    assert code == 2 and len(err.strip().splitlines()) == 1
    assert "no camera.yaml; give a calibration with --camera, such as the camera.yaml of a run" in err
