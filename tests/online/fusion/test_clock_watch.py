from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ANTENNA, DrivingCamera

from vgps.config import Config
from vgps.gps.sensors import TimeOffset
from vgps.mapping.map_update import Similarity
from vgps.model import FixClass
from vgps.online.fusion.clock_watch import ClockWatch, shown_time_offset
from vgps.online.fusion.video_path import VideoPath

LATE_S, SURE_OF_NONE = 0.4, TimeOffset(0.0, 0.01)


def shown(drive, late_s, believed):
    """What displacements show of a drive whose map has another scale, heading and place than the world."""
    fixes = drive.fixes([FixClass.RTK_FIX] * 30, np.zeros((30, 3)))
    fixes = replace(fixes, t_s=fixes.t_s + late_s)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    world = Similarity(2.0, turn, np.array([5.0, 6.0, 7.0]))
    poses = drive.true.copy()
    poses[:, :3, :3] = turn.T @ poses[:, :3, :3]
    poses[:, :3, 3] = 0.5 * (poses[:, :3, 3] - world.world_p_map) @ turn
    path = VideoPath(t_s=drive.t_s, poses=poses, moving=np.ones(len(poses), dtype=bool))
    return shown_time_offset(path, world, fixes, ANTENNA, believed, Config().sensors)


def test_displacements_show_a_time_offset_that_a_fit_does_not_believe():
    found = shown(DrivingCamera(300), LATE_S, SURE_OF_NONE)
    assert found.time_offset_s == pytest.approx(LATE_S, abs=0.02)


def test_they_say_nothing_where_the_fit_believes_the_same():
    assert shown(DrivingCamera(300), LATE_S, TimeOffset(0.38, 0.02)) is None
    assert shown(DrivingCamera(300), 0.0, SURE_OF_NONE) is None


def test_nor_on_a_straight():
    drive = DrivingCamera(300)
    drive.true[:, :3, :3] = drive.true[0, :3, :3]
    drive.true[:, :3, 3] = np.linspace(0.0, 240.0, 300)[:, None] * drive.true[0, :3, 2]
    assert shown(drive, LATE_S, SURE_OF_NONE) is None


def test_clocks_are_compared_after_ever_longer_paths():
    watch = ClockWatch(Config().sensors)
    assert [t_s for t_s in range(30) if watch.is_due(float(t_s))] == [2, 3, 4, 5, 6, 7, 8, 10, 13, 16, 20, 25]


def test_what_is_shown_twice_in_a_row_counts():
    watch, one, other = ClockWatch(Config().sensors), TimeOffset(0.36, 0.01), TimeOffset(-0.74, 0.02)
    assert [watch.confirmed(each) for each in (one, None, one, other)] == [None] * 4
    assert watch.confirmed(other) is other
