from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from nmea_text import gga, zda

from vgps.errors import GpsLogError
from vgps.model import FixClass, Rig
from vgps.readers.gps import check_overlap, gps_format, read_gps_log

NOON = datetime(2011, 9, 26, 12, tzinfo=UTC)
AT_NOON = Rig(video_start_utc=NOON)
CSV = "t_s,latitude_deg,longitude_deg,height_m,fix_class\n"


@pytest.fixture
def log(tmp_path: Path):
    """Write a log and read it, by default with a video that starts at noon."""

    def read(text: str | bytes, rig: Rig | None = AT_NOON, name: str = "gps.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_gps_log(path, rig)

    return read


def test_utc_is_put_on_the_videos_clock(log):
    text = gga("115959.50") + zda("115959.50", 26, 9, 2011) + gga("120001.25")
    np.testing.assert_allclose(log(text).t_s, [-0.5, 1.25], atol=1e-6)
    tokyo = Rig(video_start_utc=datetime.fromisoformat("2011-09-26T21:00:00+09:00"))
    np.testing.assert_allclose(log(text, tokyo).t_s, [-0.5, 1.25], atol=1e-6)
    np.testing.assert_allclose(
        log(text, Rig(video_start_utc=datetime(2011, 9, 26, 12))).t_s, [-0.5, 1.25], atol=1e-6
    )


def test_without_a_video_times_count_from_the_first_fix(log):
    np.testing.assert_allclose(log(gga("120003") + gga("120005.5"), None).t_s, [0, 2.5])


@pytest.mark.parametrize(
    ("start", "expected"),
    [
        (NOON, [-60.0, 1.0]),
        (NOON - timedelta(hours=12), [43140.0, 43201.0]),
        (NOON + timedelta(hours=11), [-39660.0, -39599.0]),
        (NOON + timedelta(hours=13), [39540.0, 39601.0]),
    ],
)
def test_a_log_without_a_date_is_of_the_nearest_day(log, start, expected):
    np.testing.assert_allclose(log(gga("115900") + gga("120001"), Rig(video_start_utc=start)).t_s, expected)


def test_a_log_without_a_date_over_midnight(log):
    rig = Rig(video_start_utc=datetime(2020, 1, 1, 0, 0, 5, tzinfo=UTC))
    np.testing.assert_allclose(log(gga("235959") + gga("000007"), rig).t_s, [-6, 2])


def test_utc_needs_the_videos_start(log):
    with pytest.raises(GpsLogError, match=r"give video_start_utc in rig\.yaml"):
        log(gga("120000") + zda("120000", 26, 9, 2011), Rig())
    with pytest.raises(GpsLogError, match="video_start_utc"):
        log(gga("120000"), Rig())


def test_a_csv_on_the_videos_clock_needs_no_start(log):
    read = log(CSV + "1.5,49.0,8.0,100.0,rtk_fix\n2.5,49.1,8.1,101.0,rtk_float\n", Rig())
    assert read.t_s.tolist() == [1.5, 2.5]
    assert read.fix_class == (FixClass.RTK_FIX, FixClass.RTK_FLOAT)
    assert read.line.tolist() == [2, 3]
    assert read.sigma_m.shape == (2, 3)


def test_impossible_positions_are_dropped_and_told(log):
    rows = ["0,49,8,100,4", "1,nan,8,100,4", "2,49,inf,100,4", "3,91,8,100,4", "4,49,8,,4", "5,49,8,100,4"]
    read = log(CSV + "\n".join(rows))
    assert read.t_s.tolist() == [0, 5]
    assert read.skipped == ("4 fixes without a possible position dropped, first line 3",)


def test_fixes_are_sorted_and_unique(log):
    read = log(CSV + "2,49.2,8,100,4\n0,49.0,8,100,4\n1,49.1,8,100,4\n1,49.9,8,100,5\n")
    assert read.t_s.tolist() == [0, 1, 2]
    assert read.latitude_deg.tolist() == [49.0, 49.1, 49.2]
    assert read.line.tolist() == [3, 4, 2]
    assert read.skipped == (
        "fixes were not in order of time; sorted",
        "1 fixes at the time of another dropped",
    )


def test_longitudes_beyond_180_come_back(log):
    read = log(CSV + "0,49,190.5,100,4\n1,49,-180,100,4\n2,49,180,100,4\n")
    assert read.longitude_deg.tolist() == [-169.5, -180.0, 180.0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b" \n\n", "the file is empty"),
        (b"hello\n", "no GPS log of a known format; expected UBX"),
        (b"\xb5\x62\x01\x03" * 50, "UBX without NAV-PVT"),
        (b'<?xml version="1.0"?><gpx></gpx>', "0 track points, none with a time"),
        (gga("120000", quality=0).encode(), r"no fix with a position \(1 epochs without a fix passed over\)"),
        (gga("120000", quality=6).encode(), "none of 1 fixes has a known class; expected rtk_fix, rtk_float"),
        (gga("120000").replace("*", "*0").encode(), "no fix with a position .*damaged"),
    ],
)
def test_what_cannot_be_used_is_told_in_one_line(log, content, message):
    with pytest.raises(GpsLogError, match=message) as error:
        log(content)
    assert "gps.txt" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_told(tmp_path):
    with pytest.raises(GpsLogError, match=r"none\.nmea: cannot be read \(No such file"):
        read_gps_log(tmp_path / "none.nmea")
    assert gps_format(tmp_path / "none.nmea") is None


def test_overlap_tells_both_spans(log):
    rig = Rig(video_start_utc=NOON)
    read = log(gga("120000") + zda("120000", 25, 9, 2011) + gga("120010"))
    with pytest.raises(GpsLogError) as error:
        check_overlap(read, np.arange(11) / 10, rig)
    assert "the log runs from 2011-09-25 12:00:00 to 2011-09-25 12:00:10 UTC" in str(error.value)
    assert "runs from 2011-09-26 12:00:00 to 2011-09-26 12:00:01 UTC" in str(error.value)
    with pytest.raises(GpsLogError, match=r"from 5\.0 s to 6\.0 s of the video's clock"):
        check_overlap(log(CSV + "5,49,8,100,4\n6,49,8,100,4\n"), np.arange(3.0), Rig())


def test_one_fix_within_the_video_is_an_overlap(log):
    read = log(CSV + "-5,49,8,100,4\n2,49,8,100,4\n60,49,8,100,4\n")
    check_overlap(read, np.arange(3.0), Rig())
    with pytest.raises(GpsLogError):
        check_overlap(read, np.arange(2.0), Rig())


def test_a_year_out_of_the_calendar_is_told_too(log):
    with pytest.raises(GpsLogError, match="no fix during the video"):
        check_overlap(log(CSV + "1e15,49,8,100,4\n"), np.arange(3.0), Rig(video_start_utc=NOON))


def test_the_real_logs(data_dir):
    rig = Rig(video_start_utc=NOON)
    kitti = read_gps_log(data_dir / "kitti03/gps_float.nmea", rig)
    np.testing.assert_allclose(kitti.t_s, np.arange(80) + 0.03, atol=1e-6)
    assert [kitti.fix_class.count(kind) for kind in (FixClass.RTK_FIX, FixClass.RTK_FLOAT)] == [16, 64]
    survey = read_gps_log(data_dir / "survey/stationary.nmea")
    kinds = (FixClass.RTK_FIX, FixClass.RTK_FLOAT, FixClass.SINGLE)
    assert [survey.fix_class.count(kind) for kind in kinds] == [316, 289, 9]
    original = read_gps_log(data_dir / "survey/stationary_original.csv")
    assert original.fix_class == survey.fix_class
    np.testing.assert_allclose(original.latitude_deg, survey.latitude_deg, atol=1e-8)


def test_one_walk_as_ubx_and_as_pos_agrees(data_dir):
    """The receiver's messages are of the same epochs as the .pos, leap seconds included."""
    rig = Rig(video_start_utc=datetime(2025, 8, 28, 17, 30, tzinfo=UTC))
    mixed, pos = (read_gps_log(data_dir / "rtk_walk" / name, rig) for name in ("gnss.ubx", "gnss.pos"))
    assert gps_format(mixed.source) == "ubx"
    np.testing.assert_allclose(mixed.t_s, pos.t_s, atol=2e-3)
    assert mixed.fix_class == pos.fix_class
    np.testing.assert_allclose(mixed.latitude_deg, pos.latitude_deg, atol=1e-7)
