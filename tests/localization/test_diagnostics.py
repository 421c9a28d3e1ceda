from dataclasses import replace

import numpy as np
import pytest
from landmark_matches import matched
from textured_wall import WallVideo, recording_of

from vgps.config import LocalizationConfig
from vgps.localization.diagnostics import loss_warnings, sensor_warnings, speed_warnings
from vgps.localization.pose import NO_MATCHES
from vgps.localization.tracker import TrackedFrame

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


def frames_at(**north_m):
    """Frames at 10 Hz, all lost but those named: ``s3`` is a start, ``f4`` followed, with positions."""
    frames = []
    for k in range(8):
        start, followed = north_m.get(f"s{k}"), north_m.get(f"f{k}")
        tracked = start is not None or followed is not None
        pose = np.eye(4)
        pose[2, 3] = start if start is not None else followed if followed is not None else np.nan
        points = pose[:3, 3] + np.array([[0, 0, 20.0]])
        matches = matched(np.array([1]), points, np.zeros((1, 2)), np.ones(1))
        frames.append(
            TrackedFrame(
                t_s=k / 10,
                world_T_camera=pose,
                covariance=np.eye(6),
                tracked=tracked,
                recovered=start is not None,
                observations=matches if tracked else NO_MATCHES,
                correlation=0.9,
            )
        )
    return frames


def speed_warning(**north_m):
    return speed_warnings(frames_at(**north_m), 700.0, LocalizationConfig())


def test_a_loss_at_high_speed_names_the_speed_and_the_settings():
    # 16 m in 0.4 s are 40 m/s; in a tenth of a second a landmark 20 m away moves by 140 px
    (warning,) = speed_warning(s0=0.0, s4=16.0, f5=20.0, f6=24.0, f7=28.0)
    assert warning == (
        "the camera was lost in the frame after 1 of its starts, where windows are for "
        "localization.max_speed_m_s = 15 m/s, while it moved at up to 40 m/s: set "
        "localization.max_speed_m_s to 50 and localization.max_window_px to 140 with --config"
    )


def test_a_loss_without_any_later_pose_is_reported_with_a_condition():
    (warning,) = speed_warning(s0=0.0)
    assert warning.startswith("frame 1 was lost right after a start")
    assert "if the camera was faster, raise it with --config" in warning


@pytest.mark.parametrize(
    "north_m",
    [
        {"s0": 0.0, "s4": 4.0, "f5": 5.0, "f6": 6.0, "f7": 7.0},  # 10 m/s: lost for another reason
        {"s0": 0.0, "s4": 400.0, "f5": 404.0, "f6": 408.0, "f7": 412.0},  # 1,000 m/s: a false pose
        {"s0": 0.0, "f1": 4.0, "s4": 16.0, "f5": 20.0, "f6": 24.0, "f7": 28.0},  # lost at known velocity
        {"s0": 0.0, "s1": 4.0, "s6": 24.0, "f7": 28.0},  # known from two starts in a row
    ],
)
def test_other_losses_are_not_put_down_to_speed(north_m):
    assert speed_warning(**north_m) == ()
