import numpy as np
import pytest

from vgps.errors import GyroLogError
from vgps.readers.gyro import read_gyro

HEADER = "t_s,wx_rad_s,wy_rad_s,wz_rad_s\n"


def test_samples_are_sorted_unique_and_on_the_videos_clock(tmp_path):
    path = tmp_path / "gyro.csv"
    path.write_text(HEADER + "10.2,1,2,3\n10.1,4,5,6\n10.2,7,8,9\n10.3,nan,0,0\n10.4,0.1,0.2,0.3\n10.5,1")
    gyro = read_gyro(path, video_start_s=10.0)
    np.testing.assert_allclose(gyro.t_s, [0.1, 0.2, 0.4], atol=1e-9)
    np.testing.assert_allclose(gyro.rate_rad_s, [[4, 5, 6], [1, 2, 3], [0.1, 0.2, 0.3]])


def test_a_missing_column_is_refused(tmp_path):
    path = tmp_path / "gyro.csv"
    path.write_text("t_s,wx,wy,wz\n0,1,2,3\n")
    with pytest.raises(GyroLogError, match="no column wx_rad_s"):
        read_gyro(path)


def test_the_log_of_kitti03_shake_begins_before_the_video(data_dir):
    gyro = read_gyro(data_dir / "kitti03_shake/gyro.csv", video_start_s=10.0)
    assert gyro.rate_rad_s.shape == (6061, 3)
    np.testing.assert_allclose(gyro.t_s[:2], [-0.2, -0.195], atol=1e-9)
