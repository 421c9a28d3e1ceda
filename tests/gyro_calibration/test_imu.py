"""The calibration of an IMU against the video, as a library and as a verb."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from angles import apart_deg

from vgps.gyro_calibration.imu import _with_mounting, calibrate_imu
from vgps.imu.mount_fit import Mount
from vgps.model import ImuLog, Recording, Rig
from vgps.readers.calibration.rig_file import read_rig
from vgps.simulate import SCENES, AccelerometerConfig, simulate


@pytest.mark.slow
def test_mounting_and_biases_of_a_hand_held_imu_are_found(tmp_path, vgps_verb):
    walk = replace(
        SCENES["demo"],
        speed=((0.0, 1.2), (8.0, 1.2)),
        width=320,
        height=214,
        focal_px=276.0,
        texture_scale=0.5,
        shake_deg=3.0,
        max_samples=4,
        accelerometer=AccelerometerConfig(),
    )
    folder, out = tmp_path / "walk", tmp_path / "rig.yaml"
    simulate(folder, walk, seed=2)
    true = read_rig(folder / "rig.yaml")
    settings = tmp_path / "settings.yaml"
    settings.write_text("tracking: {max_features: 200}\n")
    code, _, error = vgps_verb("calibrate-imu", folder, "--config", settings, "--out", out)
    assert code == 0, error
    found = read_rig(out)
    assert apart_deg(found.imu.imu_R_camera, true.imu.imu_R_camera) < 0.5
    assert abs(found.imu_time_offset_s) < 0.005
    assert found.imu.gyro_density == pytest.approx(0.0017 / np.sqrt(200.0), rel=0.2)
    np.testing.assert_array_equal(found.imu.imu_p_camera, true.imu.imu_p_camera)
    written = yaml.safe_load(out.read_text(encoding="utf-8"))
    biases = np.loadtxt(folder / "imu_biases.csv", delimiter=",", skiprows=1)
    middle = biases[np.abs(biases[:, 0] - 4.0).argmin()]
    gyro_sigma = np.array(written["imu_gyro_bias_sigma_rad_s"])
    force_sigma = np.array(written["imu_accelerometer_bias_sigma_m_s2"])
    assert gyro_sigma.max() < 0.002 and force_sigma.max() < 0.15
    assert (np.abs(found.imu.gyro_bias_rad_s - middle[1:4]) < 3.0 * gyro_sigma).all()
    assert (np.abs(found.imu.accelerometer_bias_m_s2 - middle[4:]) < 3.0 * force_sigma).all()


def test_the_mounting_adds_to_what_is_not_known_of_the_accelerometer():
    t = np.arange(2.0)
    up = np.tile([0.0, 0.0, 10.0], (2, 1))
    log = ImuLog(t_s=t, rate_rad_s=0.0 * up, force_m_s2=up, saturated=t < 0, source=Path("imu.csv"))
    mount, sigma_rad = Mount(np.eye(3), 0.0, np.zeros(3)), np.array([3e-3, 4e-3, 1.0])
    found = SimpleNamespace(mount=mount, rotation_sigma_rad=sigma_rad)
    by_path = {"accelerometer_sigma_m_s2": [0.03, 0.04, 0.02]}
    np.testing.assert_allclose(_with_mounting(by_path, found, log), [0.05, 0.05, 0.02])


def test_without_fixes_the_accelerometer_is_left_out_with_a_note(monkeypatch):
    """The calibration of the gyro has its own tests; here it is given."""
    gyro = SimpleNamespace(notes=("a note",), rig_fields=lambda: {"gyro_R_camera": np.eye(3).tolist()})
    monkeypatch.setattr("vgps.gyro_calibration.imu.calibrate_gyro", lambda *_: gyro)
    recording = Recording(path=Path(), video=None, camera=None, rig=Rig())
    t = np.arange(0.0, 20.0, 0.01)
    noise = np.random.default_rng(0).normal(size=(len(t), 3))
    log = ImuLog(t_s=t, rate_rad_s=noise, force_m_s2=noise, saturated=t < 0, source=Path("imu.csv"))
    found = calibrate_imu(recording, log)
    assert "imu_accelerometer_bias_m_s2" not in found.fields and not found.biases
    assert found.notes[0] == "a note" and "it takes fixes (--gps)" in found.notes[1]
    assert found.fields["imu_accelerometer_density"] == pytest.approx(0.1, rel=0.1)
