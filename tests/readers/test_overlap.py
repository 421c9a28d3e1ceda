from datetime import UTC, datetime

import numpy as np
import pytest
from solutions import make_gps_log

from vgps.errors import GpsLogError
from vgps.model import FixClass, GpsLog, Rig
from vgps.readers.overlap import check_overlap

AT_NOON = Rig(video_start_utc=datetime(2011, 9, 26, 12, tzinfo=UTC))


def log(*t_s: float) -> GpsLog:
    return make_gps_log(np.array(t_s), (FixClass.RTK_FIX,) * len(t_s))


def test_no_overlap_names_both_spans():
    with pytest.raises(GpsLogError) as error:
        check_overlap(log(-86400.0, -86390.0), np.arange(11) / 10, AT_NOON)
    assert "the log runs from 2011-09-25 12:00:00 to 2011-09-25 12:00:10 UTC" in str(error.value)
    assert "runs from 2011-09-26 12:00:00 to 2011-09-26 12:00:01 UTC" in str(error.value)
    with pytest.raises(GpsLogError, match=r"from 5\.0 s to 6\.0 s of the video's clock"):
        check_overlap(log(5.0, 6.0), np.arange(3.0), Rig())


def test_one_fix_within_the_video_is_an_overlap():
    read = log(-5.0, 2.0, 60.0)
    check_overlap(read, np.arange(3.0), Rig())
    with pytest.raises(GpsLogError):
        check_overlap(read, np.arange(2.0), Rig())


def test_a_year_out_of_the_calendar_has_a_message_too():
    with pytest.raises(GpsLogError, match="no fix during the video"):
        check_overlap(log(1e15), np.arange(3.0), AT_NOON)


def test_a_start_in_local_time_is_recognised_by_whole_half_hours():
    seconds = np.arange(61.0)
    in_utc = log(*(seconds - 5.5 * 3600.0))  # the rig gave 12:00 in India as UTC
    with pytest.raises(GpsLogError, match="write it with its zone: 2011-09-26T12:00:00\\+05:30"):
        check_overlap(in_utc, seconds, AT_NOON)
    with pytest.raises(GpsLogError, match="check video_start_utc in rig"):
        check_overlap(log(*(seconds - 5.6 * 3600.0)), seconds, AT_NOON)
