from dataclasses import replace

import numpy as np
import pytest
from angles import apart_deg
from synthetic_rotations import MOUNT, NOISE, noisy, rich

from vgps.config import GyroCalibrationConfig
from vgps.errors import GeometryError, GyroLogError
from vgps.gyro_calibration import calibrate_from_rotations
from vgps.model import GyroLog

CONFIG = GyroCalibrationConfig()


@pytest.mark.slow
def test_rotation_offset_and_bias_are_estimated_within_their_sigmas():
    found = calibrate_from_rotations(*noisy(rich), CONFIG)
    assert apart_deg(found.mount.gyro_R_camera, MOUNT.gyro_R_camera) < 0.15
    assert abs(found.mount.time_offset_s - MOUNT.time_offset_s) < 4 * found.time_offset_sigma_s < 0.005
    assert (np.abs(found.mount.bias_rad_s - MOUNT.bias_rad_s) < 4 * found.bias_sigma_rad_s).all()
    assert np.degrees(found.rotation_sigma_rad).max() < 0.25
    assert found.offset_known and found.bias_known and not found.notes
    assert found.agreement > 0.995 and found.scale == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(found.residual_rad, NOISE, rtol=0.3)


@pytest.mark.slow
def test_what_goes_into_the_rig():
    fields = calibrate_from_rotations(*noisy(rich), CONFIG).rig_fields()
    assert set(fields) == {
        "gyro_R_camera",
        "gyro_rotation_sigma_deg",
        "gyro_time_offset_s",
        "gyro_time_offset_sigma_s",
        "gyro_bias_rad_s",
        "gyro_bias_sigma_rad_s",
    }
    assert apart_deg(np.array(fields["gyro_R_camera"]), MOUNT.gyro_R_camera) < 0.15


@pytest.mark.slow
def test_uncertain_estimates_are_noted_and_not_written():
    strict = replace_config(max_offset_sigma_s=1e-7, max_bias_sigma_deg_s=1e-5)
    found = calibrate_from_rotations(*noisy(rich), strict)
    assert not found.offset_known and not found.bias_known
    assert set(found.rig_fields()) == {"gyro_R_camera", "gyro_rotation_sigma_deg"}
    assert [note.split(" is only known")[0] for note in found.notes] == ["the clock offset", "the bias"]


def replace_config(**changes):
    return CONFIG.model_copy(update=changes)


@pytest.mark.slow
def test_a_motion_that_repeats_itself_leaves_the_offset_open():
    def periodic(t_s):
        phase = 2 * np.pi * t_s / 0.5
        return np.stack([np.sin(phase), np.cos(phase), np.sin(phase + 0.7)], axis=-1)

    found = calibrate_from_rotations(*noisy(periodic), CONFIG)
    assert not found.offset_known and "gyro_time_offset_s" not in found.rig_fields()
    assert any("repeats itself" in note for note in found.notes)


@pytest.mark.slow
def test_a_wrong_focal_length_is_noted():
    turns, gyro = noisy(rich)
    found = calibrate_from_rotations(turns, replace(gyro, rate_rad_s=1.08 * gyro.rate_rad_s), CONFIG)
    assert found.scale == pytest.approx(1 / 1.08, abs=0.01)
    assert any("check the focal length" in note for note in found.notes)


def test_a_log_of_another_time_is_refused():
    turns, gyro = noisy(rich)
    with pytest.raises(GyroLogError, match="video_start_s"):
        calibrate_from_rotations(turns, replace(gyro, t_s=gyro.t_s + 500.0), CONFIG)


def test_too_short_a_video_is_refused():
    turns, gyro = noisy(rich)
    short = turns.where(np.arange(len(turns)) < 20)
    with pytest.raises(GeometryError, match="20 intervals have a rotation"):
        calibrate_from_rotations(short, gyro, CONFIG)


@pytest.mark.slow
def test_a_gap_in_the_log_costs_its_intervals_alone():
    turns, gyro = noisy(rich)
    kept = (gyro.t_s < 4.0) | (gyro.t_s > 6.0)
    gappy = GyroLog(gyro.t_s[kept], gyro.rate_rad_s[kept], gyro.source)
    found = calibrate_from_rotations(turns, gappy, CONFIG)
    assert apart_deg(found.mount.gyro_R_camera, MOUNT.gyro_R_camera) < 0.2
    assert 40 <= found.missed <= 46 and found.intervals + found.missed == len(turns)
