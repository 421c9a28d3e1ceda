"""The calibration of an IMU against the video, as a library and as a verb."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vgps.readers.calibration import read_rig
from vgps.simulate import SCENES, AccelerometerConfig, simulate


@pytest.mark.slow
def test_the_mounting_of_a_hand_held_imu_is_found(tmp_path):
    walk = replace(
        SCENES["demo"],
        speed=((0.0, 1.2), (8.0, 1.2)),
        width=360,
        height=240,
        focal_px=310.0,
        texture_scale=0.5,
        shake_deg=3.0,
        accelerometer=AccelerometerConfig(),
    )
    folder, out = tmp_path / "walk", tmp_path / "rig.yaml"
    simulate(folder, walk, seed=2)
    true = read_rig(folder / "rig.yaml")
    words = ["-m", "vgps", "calibrate-imu", folder, "--out", out]
    done = subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = read_rig(out)
    off = Rotation.from_matrix(found.imu.imu_R_camera.T @ true.imu.imu_R_camera).magnitude()
    assert np.degrees(off) < 0.5 and abs(found.imu_time_offset_s) < 0.005
    assert found.imu.gyro_density == pytest.approx(0.0017 / np.sqrt(200.0), rel=0.2)
    np.testing.assert_array_equal(found.imu.imu_p_camera, true.imu.imu_p_camera)
