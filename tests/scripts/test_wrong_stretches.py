from dataclasses import replace

import brief_videos
import numpy as np
import pytest

from scripts.common.drives import open_drive
from scripts.experiments.wrong_stretches import live_row, row, thinned, with_wrong_stretch


@pytest.fixture
def drive(data_dir):
    return open_drive("kitti07", data_dir, data_dir)


@pytest.fixture
def log(drive):
    return drive.read_log(drive.shipped()["gps_moving.nmea"])


def test_a_thinned_log_has_so_many_fixes_a_second(log):
    assert len(log) == 159
    assert len(thinned(log, 10.0)) == 159
    one = thinned(log, 1.0)
    assert len(one) == 16 and np.diff(one.t_s).min() > 0.85


def test_one_stretch_is_moved_by_one_vector(drive, log):
    moved, wrong = with_wrong_stretch(log, drive, 12.0, 4.0, np.random.default_rng(0))
    by = drive.errors(moved) - drive.errors(log)
    assert wrong.sum() == 40 and np.flatnonzero(np.diff(wrong)).shape == (2,)
    np.testing.assert_allclose(np.linalg.norm(by, axis=1), np.where(wrong, 12.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(np.ptp(by[wrong], axis=0), 0.0, atol=1e-6)


def every_second_frame(drive):
    return replace(drive, recording=brief_videos.thinned(drive.recording, 2))


@pytest.mark.slow
def test_a_wrong_stretch_of_a_fast_receiver_is_rejected_on_a_real_drive(drive, log):
    """Ten fixes a second, two seconds of which are 12 m off."""
    moved, wrong = with_wrong_stretch(log, drive, 12.0, 2.0, np.random.default_rng(1))
    found = row(every_second_frame(drive), moved, wrong, 0)
    assert found["wrong"] == 20 and found["missed"] == 0 and found["good_doubted"] == 0
    assert found["mean_m"] < 0.15 < found["fixes_mean_m"]


@pytest.mark.slow
def test_nor_does_the_live_pose_follow_it(data_dir):
    drive = open_drive("kitti07:0-99", data_dir, data_dir)
    log = drive.read_log(drive.shipped()["gps_moving.nmea"])
    moved, _ = with_wrong_stretch(log, drive, 12.0, 2.0, np.random.default_rng(1))
    found = live_row(every_second_frame(drive), moved, 0)
    assert found["live_mean_m"] < 0.3 and found["live_max_m"] < 1.5
    assert found["live_nees"] < 10.0 and found["live_beyond_three_sigmas"] < 0.05
