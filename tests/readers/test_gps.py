import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nmea_text import gga, gst, rmc, with_checksums, zda

from vgps.errors import GpsLogError
from vgps.model import FixClass, Rig
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.overlap import check_overlap

NOON = datetime(2011, 9, 26, 12, tzinfo=UTC)
AT_NOON = Rig(video_start_utc=NOON)
CSV = "t_s,latitude_deg,longitude_deg,height_m,fix_class\n"
POS_REST = "1 11 0.02 0.01 0.03 -0.04 0.09 -0.12 1.5 2.0\n"
ECEF = "-1275936.1 -4717150.9 4086446.2 "
TEXTS = {
    "nmea": "".join(
        gga(f"12000{k}") + gst(f"12000{k}") + zda(f"12000{k}", 26, 9, 2011) + rmc(f"12000{k}", "260911")
        for k in range(2)
    ),
    "pos calendar": "% GPST latitude(deg) longitude(deg) height(m) Q ns\n"
    f"2020/12/24 21:28:42.5 40.1 -105.1 1578.8 {POS_REST}2020/12/24 21:28:43.5 40.1 -105.1 1578.8 {POS_REST}",
    "pos ecef": "% GPST x-ecef(m) y-ecef(m) z-ecef(m) Q ns\n"
    f"2137 422922.5 {ECEF}{POS_REST}2137 422923.5 {ECEF}{POS_REST}",
    "pos baseline": "% ref pos : 40 07 47.83 -105 13 58.99 1669.9\n% GPST e-baseline(m) n-baseline(m) Q ns\n"
    f"2137 422922.5 100.0 -200.0 5.0 {POS_REST}2137 422923.5 100.0 -200.0 5.0 {POS_REST}",
    "srt": "1\n00:00:00,000 --> 00:00:00,500\n[latitude: 48.1] [longitude: 11.5] [abs_alt: 530.2]\n\n"
    "2\n00:00:00,500 --> 00:00:01,000\n[latitude: 48.2] [longitude: 11.5] [abs_alt: 530.2]\n",
    "old srt": "1\n00:00:00,000 --> 00:00:00,500\nGPS(11.5,48.1,530) BAROMETER:10.1\n\n"
    "2\n00:00:00,500 --> 00:00:01,000\nGPS(11.6,48.1,530) BAROMETER:10.1\n",
    "csv": "utc,lat,lon,height_m,fix_class,sigma_east_m,hdop,satellites,age_s\n"
    "2020-12-24T21:28:42Z,40.1,-105.1,1578.8,4,0.1,0.8,12,1.5\n1608845324,40.1,-105.1,1578.8,4,0.1,0.8,12,1.5\n",
    "gpx": '<gpx version="1.1" creator="t"><trk><trkseg><trkpt lat="49.0" lon="8.4"><ele>100.5</ele>'
    "<time>2024-12-31T23:59:59.5Z</time><sat>9</sat><hdop>1.2</hdop><ageofdgpsdata>3</ageofdgpsdata></trkpt>"
    '<trkpt lat="49.1" lon="8.4"><ele>101</ele><time>2025-01-01T00:00:00.5Z</time></trkpt>'
    "</trkseg></trk></gpx>",
    "rmc": rmc("120000", "260911") + rmc("120001", "260911"),
    "kml": '<kml xmlns:gx="g"><gx:Track><when>2011-09-26T12:00:00Z</when><when>2011-09-26T12:00:01Z</when>'
    "<gx:coord>8.4 49.0 116.5</gx:coord><gx:coord>8.5 49.1 117.5</gx:coord></gx:Track></kml>",
    "android": "# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n"
    "Fix,gps,49.1,8.4,116.5,0.0,3.0,1317038400000\nFix,gps,49.1,8.5,116.5,0.0,3.0,1317038401000\n",
}
ABSURD = [
    "9" * 400,
    "99999999999",
    "20000000000000000000",
    "-1",
    "75",
    "10000",
    "0",
    "",
    "nan",
    "inf",
    "-inf",
]
ABSURD += ["1e308", "-1e308", "1e999", "1e15", "-1e30", "1e-400"]


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
    with pytest.raises(GpsLogError, match=r"set it in rig\.yaml, as video_start_utc: 2026"):
        log(gga("120000") + zda("120000", 26, 9, 2011), Rig())
    with pytest.raises(GpsLogError, match="video_start_utc"):
        log(gga("120000"), Rig())


def test_a_csv_on_the_videos_clock_needs_no_start(log):
    read = log(CSV + "1.5,49.0,8.0,100.0,rtk_fix\n2.5,49.1,8.1,101.0,rtk_float\n", Rig())
    assert read.t_s.tolist() == [1.5, 2.5]
    assert read.fix_class == (FixClass.RTK_FIX, FixClass.RTK_FLOAT)
    assert read.line.tolist() == [2, 3]
    assert read.sigma_m.shape == (2, 3)


def test_impossible_positions_are_dropped_and_counted(log):
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
        "1 fix at the time of another dropped",
    )


def test_longitudes_beyond_180_come_back(log):
    read = log(CSV + "0,49,190.5,100,4\n1,49,-180,100,4\n2,49,180,100,4\n")
    assert read.longitude_deg.tolist() == [-169.5, -180.0, 180.0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b" \n\n", "the file is empty"),
        (b"hello\n", "not a GPS log of a known format; expected UBX"),
        (b"\xb5\x62\x01\x03" * 50, "UBX without NAV-PVT"),
        (b'<?xml version="1.0"?><gpx></gpx>', "0 track points, none with a time"),
        (gga("120000", quality=0).encode(), r"no fix with a position \(1 epoch without a fix skipped\)"),
        (gga("120000", quality=6).encode(), "none of 1 fixes has a known class; expected rtk_fix, rtk_float"),
        (gga("120000").replace("*", "*0").encode(), "no fix with a position .*damaged"),
    ],
)
def test_unusable_logs_are_refused_in_one_line(log, content, message):
    with pytest.raises(GpsLogError, match=message) as error:
        log(content)
    assert "gps.txt" in str(error.value)
    assert "\n" not in str(error.value)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(GpsLogError, match=r"none\.nmea: cannot be read \(No such file"):
        read_gps_log(tmp_path / "none.nmea")
    assert gps_format(tmp_path / "none.nmea") is None


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", TEXTS)
@given(st.data())
def test_an_absurd_number_is_skipped_or_refused(tmp_path_factory, name, data):
    """Instead of any number of a log, whatever the format: a fix less, or a message, and no other harm."""
    text, path = TEXTS[name], tmp_path_factory.getbasetemp() / "absurd.txt"
    number = data.draw(st.sampled_from(list(re.finditer(r"\d+(\.\d+)?", text))))
    text = text[: number.start()] + data.draw(st.sampled_from(ABSURD)) + text[number.end() :]
    path.write_text(with_checksums(text) if name in {"nmea", "rmc"} else text)
    try:
        read = read_gps_log(path, data.draw(st.sampled_from([None, AT_NOON])))
        check_overlap(read, np.arange(2.0), AT_NOON)
    except GpsLogError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite([read.t_s, read.height_m]).all()
        assert np.abs(read.height_m).max() <= 1e8


@pytest.mark.slow
def test_real_logs_have_their_fixes_classes_and_places(data_dir):
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


def nmea_of_digits(minutes: int, metres: int) -> str:
    """Ten RTK-fixes with so many decimals of minutes and of the height above the sea."""
    lines = ""
    for k in range(10):
        minute, height = 0.6612345678 + 1.111e-4 * k, 116.1234 + 0.0111 * k
        place = f"490{minute:.{minutes}f},N,0082{4.9912345678 + minute:.{minutes}f},E"
        lines += f"$GNGGA,12000{k},{place},4,14,0.80,{height:.{metres}f},M,47.9,M,1.5,0000\n"
    return with_checksums(lines) + zda("120009", 26, 9, 2011)


@pytest.mark.parametrize(
    ("minutes", "metres", "north_m", "up_m"),
    [(4, 1, 0.185, 0.1), (5, 1, 0.0185, 0.1), (7, 4, 0.0, 0.0)],
)
def test_the_errors_of_the_last_digits_are_those_of_the_sentences(tmp_path, minutes, metres, north_m, up_m):
    (tmp_path / "gps.nmea").write_text(nmea_of_digits(minutes, metres))
    log = read_gps_log(tmp_path / "gps.nmea", AT_NOON)
    east_m = north_m * np.cos(np.radians(49.01))
    expected = np.array([east_m, north_m, up_m]) / np.sqrt(12.0)
    np.testing.assert_allclose(log.logging_sigma, [expected] * 10, rtol=3e-3)
    told = "the last digits of the positions are steps of"
    assert any(told in note for note in log.skipped) == (north_m > 0.1 or up_m >= 0.1)
