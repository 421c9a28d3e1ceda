import numpy as np
import pytest

from vgps.errors import ImuLogError
from vgps.model import Rig
from vgps.readers.imu import checked_imu, during_video, on_video_clock, read_imu
from vgps.readers.recording import open_recording

HEADER = "t_s,wx_rad_s,wy_rad_s,wz_rad_s,ax_m_s2,ay_m_s2,az_m_s2\n"


def log(folder, count=400, rate_hz=100.0, gyro=0.1, force=9.8, change=lambda values: values):
    """A resting IMU with a little noise, as text."""
    rng = np.random.default_rng(0)
    values = np.zeros((count, 7))
    values[:, 0] = np.arange(count) / rate_hz
    values[:, 1:4] = gyro + 0.01 * rng.standard_normal((count, 3))
    values[:, 6] = force
    values[:, 4:] += 0.01 * force * rng.standard_normal((count, 3))
    path = folder / "imu.csv"
    np.savetxt(path, change(values), "%.6f", ",", header=HEADER.strip(), comments="")
    return path


def test_samples_are_sorted_unique_and_on_the_videos_clock(tmp_path):
    path = tmp_path / "imu.csv"
    rows = ["10.02,1,2,3,0,0,9", "10.01,4,5,6,0,9,0", "10.02,7,8,9,0,0,9", "10.03,nan,0,0,0,0,9"]
    path.write_text(HEADER + "\n".join([*rows, "10.04,0,0,0,inf,0,9\n"]))
    imu = read_imu(path, video_start_s=10.0)
    np.testing.assert_allclose(imu.t_s, [0.01, 0.02], atol=1e-9)
    np.testing.assert_array_equal(imu.rate_rad_s, [[4, 5, 6], [1, 2, 3]])
    np.testing.assert_array_equal(imu.force_m_s2, [[0, 9, 0], [0, 0, 9]])
    assert imu.notes[0] == "3 samples of the IMU skipped"


def test_a_missing_column_is_refused(tmp_path):
    path = tmp_path / "imu.csv"
    path.write_text("t_s,wx_rad_s\n0,1\n")
    with pytest.raises(ImuLogError, match="no column wy_rad_s"):
        read_imu(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"force": 1.0}, r"median size 0\.999.*multiply by 9\.80665: the unit is g"),
        ({"force": 0.01}, r"with gravity"),
        ({"gyro": 100.0}, r"rates of up to 17\d rad/s; .*pi / 180"),
        ({"change": lambda v: v[:, [0, 4, 5, 6, 1, 2, 3]]}, "swap the columns"),
    ],
)
def test_other_units_and_orders_are_named(tmp_path, changes, message):
    with pytest.raises(ImuLogError, match=message):
        read_imu(log(tmp_path, **changes))


@pytest.mark.parametrize(
    ("per_s", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")]
)
def test_times_that_are_not_in_seconds_are_refused(tmp_path, per_s, unit):
    with pytest.raises(ImuLogError, match=f"a sample every .* t_s in seconds.*seems to be {unit}"):
        read_imu(log(tmp_path, change=lambda v: v * np.r_[per_s, np.ones(6)]))


def test_what_the_log_covers_of_the_video_is_said(tmp_path):
    frames, rig = np.arange(0.0, 4.0, 0.1), Rig(video_start_s=100.0, imu_time_offset_s=0.5)

    def notes(begin_s):
        shifted = on_video_clock(read_imu(log(tmp_path)), rig)  # 0.5 to 4.49 s
        return during_video(shifted, frames + begin_s, rig)

    kept, said = notes(0.5)
    assert kept is not None and said == ()
    kept, (said,) = notes(3.0)
    assert kept is not None and said == "imu.csv covers the video from 3.00 s to 4.49 s only, of 6.90 s"
    kept, (said,) = notes(50.0)
    assert kept is None
    assert "imu.csv is left out: it runs from 100.000 s to 103.990 s, the video from 150.000 s to" in said


def test_gaps_saturation_and_unusual_rates_are_said(tmp_path):
    assert read_imu(log(tmp_path)).notes == ()
    gap = read_imu(log(tmp_path, change=lambda v: np.delete(v, slice(100, 150), 0))).notes
    assert gap == ("imu.csv has 1 gap, the longest 0.51 s after 0.99 s: the video bridges them",)

    def clip(values):
        values[200:210, 1] = 4.36
        return values

    clipped = read_imu(log(tmp_path, change=clip))
    assert clipped.notes == ("imu.csv is saturated in 10 samples, first at 2.00 s: they are not used",)
    np.testing.assert_array_equal(np.flatnonzero(clipped.saturated), range(200, 210))
    slow = read_imu(log(tmp_path, rate_hz=10.0)).notes
    assert slow == ("imu.csv has 10 samples a second: 50 to 1000 are usual",)


def test_the_same_value_in_all_samples_is_no_saturation(tmp_path):
    t = np.arange(100) / 100.0
    still = checked_imu(t, np.zeros((100, 3)), np.tile([0.0, 0.0, 9.8], (100, 1)), tmp_path)
    assert not still.saturated.any()


@pytest.mark.slow
def test_a_drive_with_an_imu(data_dir):
    opened = open_recording(data_dir / "kitti07", gps="gps_fix.nmea", rig="rig_imu.yaml")
    assert opened.imu.t_s.shape == (3180,) and opened.notes == ()
    np.testing.assert_allclose(opened.rig.imu.imu_p_camera, [0.3, -0.1, 0.2])
    np.testing.assert_array_equal(opened.gyro.rate_rad_s, opened.imu.rate_rad_s)
    np.testing.assert_array_equal(opened.rig.gyro_R_camera, opened.rig.imu.imu_R_camera)


def test_an_imu_of_unknown_mounting_is_left_out(data_dir):
    opened = open_recording(data_dir / "kitti07", gps="gps_fix.nmea")
    assert opened.imu is None and opened.gyro is None
    assert opened.notes[0].startswith("imu.csv is left out: rig.yaml has no imu_R_camera")


@pytest.mark.parametrize("name", ["gopro_walk", "gopro_hero7"])
def test_gravity_is_up_in_the_picture_of_a_gopro(name, data_dir):
    from vgps.readers.gopro.gpmf import read_gpmf
    from vgps.readers.gopro.sensors import GYRO_R_CAMERA, read_gopro_imu

    imu = read_gopro_imu(read_gpmf(data_dir / name / "video.mp4"))
    mean = imu.force_m_s2.mean(axis=0) @ GYRO_R_CAMERA
    assert mean[1] == pytest.approx(-9.9, abs=0.3) and np.abs(mean[[0, 2]]).max() < 1.5
