"""The IMU of a recording in the live mode."""

import io
import json
import shutil
import threading
from dataclasses import replace

import numpy as np
import pytest
from fewer_features import fewer_features

import vgps
from scripts.benchmarks.rigs import Darkened
from vgps.errors import RecordingError
from vgps.evaluation import match_times
from vgps.online import OnlineSmoother, OnlineState
from vgps.online.replay import replay
from vgps.online.run import run_online
from vgps.online.session import OnlineOptions, pose_live, pose_recording
from vgps.readers.trajectory import read_trajectory

FRAMES = 25


def first_positions(opened, imu):
    """Camera centres (F, 3) in the map after some frames."""
    smoother, stop, seen = OnlineSmoother(opened.camera, opened.rig, imu=imu), threading.Event(), []

    def sink(estimate, _):
        seen.append(estimate)
        if len(seen) == FRAMES:
            stop.set()

    run_online(replay(opened, stop), smoother, sink, stop)
    return smoother.finish().world_T_camera[:, :3, 3]


@pytest.mark.slow
def test_the_gyro_predicts_rotations_and_the_path_stays_right(data_dir):
    opened = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea", imu="imu.csv", rig="rig_imu.yaml")
    alone, with_imu = first_positions(opened, None), first_positions(opened, opened.imu)
    away = np.linalg.norm(with_imu - alone, axis=1)
    assert 0.0 < away.max() < 0.1  # other predictions, the same features


@pytest.mark.slow
def test_two_dark_seconds_of_a_drive_are_bridged(data_dir):
    folder = data_dir / "kitti07"
    opened = vgps.open_recording(folder, gps="gps_fix.nmea", imu="imu.csv", rig="rig_imu.yaml")
    opened = replace(opened, video=Darkened(opened.video, 12.0, 14.0))
    smoother = OnlineSmoother(opened.camera, opened.rig, fewer_features(150), imu=opened.imu)
    stop, seen = threading.Event(), []

    def sink(estimate, _):
        seen.append(estimate)
        if estimate.t_s > 14.0:
            stop.set()

    run_online(replay(opened, stop), smoother, sink, stop)
    dark = [estimate for estimate in seen if 12.0 <= estimate.t_s < 14.0]
    assert len(dark) == 20 and {estimate.state for estimate in dark} == {OnlineState.BRIDGED}
    truth = read_trajectory(folder / "truth.tum")
    _, rows = match_times(np.array([estimate.t_s for estimate in dark]), truth.t_s, 0.01)
    found, true = np.array([estimate.global_T_camera for estimate in dark]), truth.world_T_camera[rows]
    error = np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1)
    stated = np.linalg.norm([estimate.sigma_position_m for estimate in dark], axis=1)
    assert error.max() < 1.0 and (error < 3.0 * stated).all() and stated[-1] > stated[0]
    turned = np.linalg.norm(found[:, :3, :3] - true[:, :3, :3], axis=(1, 2))
    assert turned.max() < 0.03  # the car turns by 54 degrees


@pytest.mark.slow
def test_an_imu_without_its_mounting_is_an_event_and_a_warning(brief, tmp_path):
    folder = tmp_path / "walk"
    shutil.copytree(brief, folder)
    (folder / "imu.csv").write_text("t_s,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n")
    lines = io.StringIO()
    pose_recording(folder, OnlineOptions(config=vgps.Config()), stream=lines)
    first = json.loads(lines.getvalue().splitlines()[0])
    assert first["event"] == "note" and first["text"].startswith("imu.csv is left out: rig.yaml has no imu_R")


def test_a_camera_has_no_log_of_an_imu(tmp_path):
    with pytest.raises(RecordingError, match="both --imu and --video"):
        pose_live("/dev/video0", None, OnlineOptions(config=vgps.Config(), imu="imu.csv", camera=tmp_path))
