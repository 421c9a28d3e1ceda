"""``vgps calibrate-gyro`` as a user runs it, and what it finds on real video."""

import shutil

import numpy as np
import pytest
import yaml
from angles import apart_deg
from brief_videos import first_frames

from vgps.gyro_calibration import calibrate_gyro
from vgps.readers.calibration.rig_file import read_rig
from vgps.readers.recording import open_recording


@pytest.mark.slow
def test_a_drive_reshot_by_a_turning_camera(data_dir, tmp_path, vgps_verb, monkeypatch):
    """Its rig has a gyro that is turned, late and biased, which does not count."""
    recording, out, results = tmp_path / "shake", tmp_path / "rig.yaml", []
    shutil.copytree(data_dir / "kitti03_shake", recording)
    given = read_rig(recording / "rig.yaml")
    wrong = {
        "gyro_time_offset_s": 0.04,
        "gyro_bias_rad_s": [0.1, 0.0, -0.1],
        "gyro_R_camera": np.eye(3).tolist(),
    }
    rig = yaml.safe_load((recording / "rig.yaml").read_text())
    (recording / "rig.yaml").write_text(yaml.safe_dump({**rig, **wrong}))
    monkeypatch.setattr(
        "vgps.gyro_calibration.calibrate_gyro",
        lambda recording, *words: (
            results.append(calibrate_gyro(first_frames(recording, 150), *words)) or results[-1]
        ),
    )
    code, printed, error = vgps_verb("calibrate-gyro", recording, "--out", out)
    assert code == 0, error
    assert "wrote" in printed and "gyro minus camera" in printed
    found = read_rig(out)
    assert apart_deg(found.gyro_R_camera, given.gyro_R_camera) < 0.5
    assert abs(found.gyro_time_offset_s) < 0.002  # the recording's clocks are one
    # the rest of the rig is what it was
    assert found.exposure_s == given.exposure_s and found.world_origin == given.world_origin
    assert found.video_start_s == given.video_start_s
    turned = np.radians(yaml.safe_load(out.read_text())["gyro_rotation_sigma_deg"])
    assert np.degrees(np.linalg.norm(turned)) < 0.5
    # per frame of 0.1 s, in which it turns by 2.5 deg about the camera's y
    (fit,) = results
    assert np.degrees(fit.residual_rad).max() < 0.1 and np.degrees(fit.rotation_rms_rad).max() > 2.4


@pytest.mark.slow
def test_a_phone_behind_a_windscreen(data_dir, tmp_path):
    """A phone held sideways: the gyro's x is against the camera's y, its y against x, its z backwards."""
    found = calibrate_gyro(open_recording(data_dir / "phone_gyro", with_gps=False))
    axes = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    assert apart_deg(found.mount.gyro_R_camera, axes) < 2.0
    assert np.degrees(found.residual_rad).max() < 0.03  # per frame of 33 ms
    assert found.offset_known and found.agreement > 0.99


def test_a_recording_without_a_gyro_is_one_line(recording, tmp_path, vgps_verb):
    bare = tmp_path / "bare"
    shutil.copytree(recording, bare)
    (bare / "gyro.csv").unlink()
    code, _, error = vgps_verb("calibrate-gyro", bare, "--out", tmp_path / "rig.yaml")
    assert code == 2 and "no gyro" in error and "add gyro.csv" in error
    assert len(error.strip().splitlines()) == 1 and not (tmp_path / "rig.yaml").exists()


@pytest.mark.slow
def test_a_simulated_walk_that_hardly_turns_about_two_axes(recording, tmp_path, vgps_verb):
    """It is found, or the motion is told to be too poor; never a rotation that is wrong and unsaid."""
    code, _, error = vgps_verb("calibrate-gyro", recording, "--out", tmp_path / "rig.yaml")
    if code == 2:
        assert "pan, tilt and roll" in error
        return
    assert code == 0, error
    found, given = read_rig(tmp_path / "rig.yaml"), read_rig(recording / "rig.yaml")
    sigma = yaml.safe_load((tmp_path / "rig.yaml").read_text())["gyro_rotation_sigma_deg"]
    assert apart_deg(found.gyro_R_camera, given.gyro_R_camera) < 4 * np.linalg.norm(sigma)
