"""An IMU whose mounting is wrong, or whose gravity has nothing to be compared with, bends no path."""

import re
from dataclasses import replace

import numpy as np
import pytest
from brief_videos import first_frames
from fewer_features import fewer_features
from scipy.spatial.transform import Rotation

import vgps

pytestmark = pytest.mark.slow

FEWER_FEATURES = fewer_features(200)


@pytest.fixture(scope="module")
def opened(data_dir):
    """Six seconds of a drive with a turn of 95 degrees."""
    drive = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea", rig="rig_imu.yaml")
    return first_frames(drive, 60)


@pytest.fixture(scope="module")
def right(opened, shared_run):
    return shared_run("brief_kitti07_imu", lambda: vgps.smooth(opened, FEWER_FEATURES))


def test_a_wrong_mounting_is_named_and_changes_nothing(opened, right):
    without = vgps.smooth(replace(opened, imu=None), FEWER_FEATURES)
    turn = Rotation.from_euler("y", 6.0, degrees=True).as_matrix()
    mount = replace(opened.rig.imu, imu_R_camera=opened.rig.imu.imu_R_camera @ turn)
    wrong = vgps.smooth(replace(opened, rig=replace(opened.rig, imu=mount)), FEWER_FEATURES)
    assert any("mounted otherwise than imu_R_camera says" in text for text in wrong.warnings)
    np.testing.assert_array_equal(wrong.world_T_camera, without.world_T_camera)
    assert np.abs(right.world_T_camera - without.world_T_camera).max() > 0.01
    (clock,) = (text for text in right.warnings if "imu" in text)
    shift = re.match(r"imu.csv was shifted by (-0\.\d{4}) s \(standard deviation (0\.00\d\d) s\)", clock)
    assert abs(float(shift[1]) + 0.009) < 3.0 * float(shift[2]) < 0.005
    assert without.sensors.imu == {}
    found, mount = right.sensors.imu, opened.rig.imu.imu_R_camera
    on_truth = {"accelerometer_{}m_s2": [-0.093, 0.035, -0.093], "gyro_{}rad_s": [-0.0054, 0.0058, 0.0044]}
    for name, bias in on_truth.items():  # as the IMU's factors give it on the true path, camera's axes
        off = np.array(found[name.format("")]) - mount @ bias
        assert (np.abs(off) < 3.0 * np.array(found[name.format("sigma_")])).all()


def test_a_clock_that_is_far_off_is_corrected_before_the_imu_counts(opened, right):
    late = replace(opened, imu=replace(opened.imu, t_s=opened.imu.t_s + 0.06))
    found = vgps.smooth(late, FEWER_FEATURES)
    clock = [text for text in found.warnings if "imu.csv was shifted by -0.0" in text]
    assert clock and not any("left out" in text for text in found.warnings)
    off = np.linalg.norm(found.world_T_camera[:, :3, 3] - right.world_T_camera[:, :3, 3], axis=1)
    assert off.mean() < 0.005  # 0.007 if stages A to C do not run again
    assert found.sensors.imu != {}


def test_without_fixes_the_imu_predicts_rotations_only(opened):
    alone = vgps.smooth(first_frames(replace(opened, gps=None), 30), FEWER_FEATURES)
    assert any("only predicted rotations" in text for text in alone.warnings)
    assert "imu.t_s" not in alone.graph and not alone.georeferenced
