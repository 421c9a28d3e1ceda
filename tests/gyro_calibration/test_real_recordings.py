"""``vgps calibrate-gyro`` as a user runs it, and what it finds on real video."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
import yaml
from synthetic_rotations import apart_deg

from vgps.gyro_calibration import calibrate_gyro
from vgps.readers.calibration.rig_file import read_rig
from vgps.readers.recording import open_recording


def calibrate(*words):
    command = [sys.executable, "-m", "vgps", "calibrate-gyro", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_drive_reshot_by_a_turning_camera(data_dir, tmp_path):
    recording, out = data_dir / "kitti03_shake", tmp_path / "rig.yaml"
    done = calibrate(recording, "--out", out)
    assert done.returncode == 0, done.stderr
    assert "wrote" in done.stdout and "gyro minus camera" in done.stdout
    given, found = read_rig(recording / "rig.yaml"), read_rig(out)
    assert apart_deg(found.gyro_R_camera, given.gyro_R_camera) < 0.5
    assert abs(found.gyro_time_offset_s) < 0.002  # the recording's clocks are one
    # the rest of the rig is what it was
    assert found.exposure_s == given.exposure_s and found.world_origin == given.world_origin
    assert found.video_start_s == given.video_start_s
    turned = np.radians(yaml.safe_load(out.read_text())["gyro_rotation_sigma_deg"])
    assert np.degrees(np.linalg.norm(turned)) < 0.5


@pytest.mark.slow
def test_the_rig_that_is_there_is_not_used(data_dir, tmp_path):
    """A rig whose gyro is turned, late and biased leads to the same answer."""
    recording = tmp_path / "shake"
    shutil.copytree(data_dir / "kitti03_shake", recording)
    rig = yaml.safe_load((recording / "rig.yaml").read_text())
    wrong = {
        "gyro_time_offset_s": 0.04,
        "gyro_bias_rad_s": [0.1, 0.0, -0.1],
        "gyro_R_camera": np.eye(3).tolist(),
    }
    (recording / "rig.yaml").write_text(yaml.safe_dump({**rig, **wrong}))
    found = calibrate_gyro(open_recording(recording, with_gps=False))
    assert apart_deg(found.mount.gyro_R_camera, np.array(rig["gyro_R_camera"])) < 0.5
    assert abs(found.mount.time_offset_s) < 0.002
    # per frame of 0.1 s, in which it turns by 2.7 deg about the camera's y
    assert np.degrees(found.residual_rad).max() < 0.1 and np.degrees(found.rotation_rms_rad).max() > 2.5


@pytest.mark.slow
def test_a_phone_behind_a_windscreen(data_dir, tmp_path):
    """A phone held sideways: the gyro's x is against the camera's y, its y against x, its z backwards."""
    found = calibrate_gyro(open_recording(data_dir / "phone_gyro", with_gps=False))
    axes = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    assert apart_deg(found.mount.gyro_R_camera, axes) < 2.0
    assert np.degrees(found.residual_rad).max() < 0.03  # per frame of 33 ms
    assert found.offset_known and found.agreement > 0.99


@pytest.mark.slow
def test_a_recording_without_a_gyro_is_one_line(recording, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(recording, bare)
    (bare / "gyro.csv").unlink()
    done = calibrate(bare, "--out", tmp_path / "rig.yaml")
    assert done.returncode == 2
    assert "no gyro" in done.stderr and "add gyro.csv" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and not (tmp_path / "rig.yaml").exists()


@pytest.mark.slow
def test_a_simulated_walk_that_hardly_turns_about_two_axes(recording, tmp_path):
    """It is found, or the motion is told to be too poor; never a rotation that is wrong and unsaid."""
    done = calibrate(recording, "--out", tmp_path / "rig.yaml")
    if done.returncode == 2:
        assert "pan, tilt and roll" in done.stderr
        return
    assert done.returncode == 0, done.stderr
    found, given = read_rig(tmp_path / "rig.yaml"), read_rig(recording / "rig.yaml")
    sigma = yaml.safe_load((tmp_path / "rig.yaml").read_text())["gyro_rotation_sigma_deg"]
    assert apart_deg(found.gyro_R_camera, given.gyro_R_camera) < 4 * np.linalg.norm(sigma)
