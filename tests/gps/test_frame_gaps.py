"""Where frames are missing, and which fixes say nothing for it."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_fixes import fixes_at, path, trajectory
from textured_room import CONFIG as ROOM_CONFIG
from textured_room import path as room_path
from textured_room import room_gps_log, room_recording

from vgps.config import SensorsConfig
from vgps.gps.clock_misfit import Seen, misfit_at
from vgps.gps.frame_gaps import frame_gaps, in_gaps
from vgps.gps.neighbour_pairs import neighbour_pairs
from vgps.gps.sensors import TimeOffset
from vgps.gps.world_frame import world_fixes
from vgps.readers.video.retimed_video import RetimedVideo

CONFIG = SensorsConfig()
TENTHS = 0.1 * np.arange(400)
WITH_GAPS = TENTHS[(TENTHS < 9.95) | (TENTHS > 12.05)]  # none between 9.9 and 12.1 s


def test_gaps_are_longer_than_usual_intervals_and_than_three_tenths_of_a_second():
    assert frame_gaps(WITH_GAPS).tolist() == [99]
    for regular in (TENTHS[::20], TENTHS[:1], TENTHS[:0]):
        assert not len(frame_gaps(regular))
    lost = np.delete(TENTHS, [50, 51, 100, 101, 102])  # intervals of 0.3 and 0.4 s
    assert frame_gaps(lost).tolist() == [97]
    slow = np.array([0.0, 1.0, 2.0, 3.4, 4.4, 6.0, 7.0])
    assert frame_gaps(slow).tolist() == [4]


@pytest.mark.parametrize(
    ("reach_s", "expected"),
    [(0.0, [False, False, True, True, False]), (1.0, [False, True, True, True, True])],
)
def test_times_in_a_gap_or_near_one(reach_s, expected):
    assert in_gaps(WITH_GAPS, np.array([8.0, 9.9, 10.0, 12.0, 13.0]), reach_s).tolist() == expected


def test_the_fixes_in_a_gap_are_not_used():
    poses = room_path(24)
    recording = room_recording(poses, gps=room_gps_log(poses))
    t_s = recording.video.times_s
    late = t_s + np.where(np.arange(24) < 12, 0.0, 1.0)
    gap = replace(recording, video=RetimedVideo(recording.video, late, np.zeros(24, dtype=bool)))
    _, whole = world_fixes(recording, ROOM_CONFIG)
    _, fixes = world_fixes(gap, ROOM_CONFIG)
    inside = (fixes.t_s > late[11]) & (fixes.t_s < late[12])
    assert whole.used.all() and inside.any()
    np.testing.assert_array_equal(fixes.used, ~inside)


def test_displacements_over_the_time_offsets_searched_stay_clear_of_gaps():
    fixes, reach_s = fixes_at(np.arange(0.05, 39.0), 0.07, 0.05), CONFIG.time_offset.search_sigmas * 0.5
    seen = trajectory(path(WITH_GAPS), WITH_GAPS)
    pairs = neighbour_pairs(seen, fixes, np.zeros(3), TimeOffset(0.0, 0.5), CONFIG.time_offset)
    t_s = pairs.fix_times_s
    assert len(t_s) and not ((t_s > 9.9 - reach_s) & (t_s < 12.1 + reach_s)).any()


def test_a_gap_says_nothing_of_a_clock():
    """A path straight across a turn in the gap would contradict right fixes."""
    fixes = fixes_at(np.arange(0.05, 39.0), 0.07, 0.05)
    place = path(WITH_GAPS) @ np.array([1.0, 1.0j, 0.0])
    found = misfit_at(Seen(WITH_GAPS, place), fixes, 0.0, CONFIG.time_offset)
    first_s = fixes.t_s[found.rows]
    assert not ((first_s > 8.95) & (first_s < 12.05)).any() and len(found.rows) > 30
