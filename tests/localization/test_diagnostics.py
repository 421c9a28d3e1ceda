from dataclasses import replace

import numpy as np
import pytest
from textured_wall import WallVideo, recording_of

from vgps.config import LocalizationConfig
from vgps.localization.diagnostics import loss_warnings, sensor_warnings

RECORDING = recording_of(WallVideo(5))


@pytest.mark.parametrize(
    ("rig", "config", "message"),
    [
        ({"gyro_R_camera": None}, {}, "no gyro_R_camera in rig.yaml, the gyro is not used"),
        ({"gyro_R_camera": None}, {}, "run vgps calibrate-gyro"),
        ({"exposure_s": None}, {}, "no exposure_s in rig.yaml: templates are not blurred"),
        (
            {},
            {"use_gyro": False},
            "the gyro is not used (use_gyro: false): rotation is predicted at constant",
        ),
    ],
)
def test_an_incomplete_rig_is_reported(rig, config, message):
    recording = replace(RECORDING, rig=replace(RECORDING.rig, **rig))
    (warning,) = sensor_warnings(recording, LocalizationConfig(**config))
    assert message in warning


def test_a_missing_gyro_is_reported():
    (warning,) = sensor_warnings(replace(RECORDING, gyro=None), LocalizationConfig())
    assert "no gyro: rotation is predicted at constant angular velocity" in warning
    assert "add gyro.csv" in warning


def test_a_gyro_log_that_is_too_short_is_reported():
    gyro = RECORDING.gyro
    short = replace(gyro, t_s=gyro.t_s[:91], rate_rad_s=gyro.rate_rad_s[:91])
    (warning,) = sensor_warnings(replace(RECORDING, gyro=short), LocalizationConfig())
    assert "the gyro covers -0.50 to -0.05 s of a video from 0.00 to 0.40 s" in warning


def test_a_complete_recording_gives_no_warning():
    assert sensor_warnings(RECORDING, LocalizationConfig()) == ()


def test_the_exposure_is_not_missed_where_templates_stay_sharp():
    recording = replace(RECORDING, rig=replace(RECORDING.rig, exposure_s=None))
    assert sensor_warnings(recording, LocalizationConfig(blur="none")) == ()


def test_lost_frames_are_listed_by_interval():
    tracked = np.ones(20, bool)
    tracked[[0, 5, 6, 7, 19]] = False
    (warning,) = loss_warnings(tracked, np.arange(20) / 10)
    assert warning == (
        "5 of 20 frames show too few landmarks and are bridged: 0, 5 to 7 (0.50 to 0.70 s), 19"
    )


def test_many_intervals_are_cut_short():
    tracked = np.arange(20) % 2 == 0
    (warning,) = loss_warnings(tracked, np.arange(20) / 10)
    assert warning.endswith("bridged: 1, 3, 5, 7, 9 and 5 more intervals")


def test_nothing_lost_gives_no_warning():
    assert loss_warnings(np.ones(4, bool), np.arange(4) / 10) == ()
