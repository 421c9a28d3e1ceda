from dataclasses import replace

import numpy as np
import pytest
from brief_videos import thinned

from scripts.common.drives import open_drive
from scripts.common.replayed_errors import make_errors
from scripts.experiments.live_antennas import live_row, with_antenna, without_antenna
from vgps.geometry import interpolate_poses


@pytest.fixture
def drive(data_dir):
    return with_antenna(open_drive("kitti07", data_dir, data_dir), 0)


def test_the_seed_moves_the_antenna_and_the_errors_with_it(data_dir, drive):
    place = drive.recording.rig.camera_p_antenna
    assert (place != open_drive("kitti07", data_dir, data_dir).recording.rig.camera_p_antenna).all()
    assert (np.abs(place) <= [0.6, 1.0, 1.0]).all()
    log = make_errors("survey_fix", drive, data_dir, 0).log
    assert np.linalg.norm(drive.errors(log), axis=1).max() < 0.05


@pytest.mark.slow
def test_turns_of_a_real_drive_show_an_antenna_that_nobody_measured(data_dir, drive):
    log = make_errors("septentrio", drive, data_dir, 0).log
    recording = thinned(replace(without_antenna(drive.recording), gps=log), 2)
    true = interpolate_poses(drive.truth.t_s, drive.truth.world_T_camera, recording.video.times_s)
    found = live_row(recording, true[:, :3, 3], 0)
    off_m = np.linalg.norm(drive.recording.rig.camera_p_antenna)
    assert found["mean_m"] < 0.6 * off_m and found["mean_m"] < 2.0 * found["sigma_m"]
