import numpy as np
import pytest

import vgps
from scripts.common.drives import open_drive
from scripts.experiments.clip_clocks import NONE, RIGHT, WRONG, clips, fixes_of, rows, verdict

CONFIG = vgps.Config()


@pytest.mark.parametrize(("found_s", "expected"), [(None, NONE), (3.3, RIGHT), (4.8, RIGHT), (-3.4, WRONG)])
def test_a_time_offset_is_right_within_the_search_that_follows(found_s, expected):
    assert verdict(found_s, 3.4, CONFIG) == expected


def test_clips_are_laid_end_to_end_and_their_logs_are_whole(data_dir):
    found = list(clips("kitti03", 15.0, data_dir))
    assert [clip.name for clip in found[:2]] == ["kitti03:0-150", "kitti03:150-300"] and len(found) == 5
    assert found[1].start_s == pytest.approx(15.0, abs=0.2)
    whole = open_drive("kitti03", data_dir, data_dir)
    times_s = fixes_of(whole, whole.shipped()["gps_fix.nmea"], CONFIG).t_s
    assert len(times_s) == 80 and np.ptp(times_s) > 78.0


@pytest.mark.slow
def test_a_clip_of_a_real_drive_shows_the_clock_of_its_logs(data_dir):
    found = {row["log"]: row for row in rows("kitti07", 10.0, [3.4], data_dir)}
    assert {row["verdict"] for row in found.values()} == {RIGHT}
    assert found["gps_fix.nmea"]["found_s"] == pytest.approx(3.4, abs=0.15)
