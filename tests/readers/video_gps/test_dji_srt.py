import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.crs import egm96
from vgps.errors import GpsLogError
from vgps.model import FixClass, Rig
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.video_gps.dji_srt import read_dji_srt

NEW = (
    "[iso : 100] [shutter : 1/1000.0] [fnum : 280] [latitude: {}] [longitude: {}] [rel_alt: {} abs_alt: {}] "
)
WORDS = '<font size="28">SrtCnt : 1, DiffTime : 33ms\n2024-05-31 14:43:55.123\n{}</font>'


def clock(t_s: float) -> str:
    ms = round(t_s * 1000)
    return f"{ms // 3_600_000:02}:{ms // 60_000 % 60:02}:{ms // 1000 % 60:02},{ms % 1000:03}"


def subtitles(texts, step_s=1 / 30, start_s=0.0):
    times = [start_s + step_s * index for index in range(len(texts) + 1)]
    return "".join(
        f"{n}\n{clock(a)} --> {clock(b)}\n{text}\n\n"
        for n, (a, b, text) in enumerate(zip(times, times[1:], texts, strict=False), 1)
    )


@pytest.fixture
def read(tmp_path):
    def written(text, name="DJI_0001.SRT", rig=Rig()):  # noqa: B008 - never changed
        file = tmp_path / name
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_gps_log(file, rig)

    return written


def test_the_new_form_by_hand(read, tmp_path):
    places = [(48.1, 11.5, 10.1, 530.2), (48.1, 11.5, 10.1, 530.2), (48.10001, 11.5, 10.3, 530.4)]
    found = read(subtitles([WORDS.format(NEW.format(*place)) for place in places], 0.25))
    assert gps_format(tmp_path / "DJI_0001.SRT") == "srt"
    # the second subtitle repeats the first one's position
    np.testing.assert_allclose(found.t_s, [0.0, 0.5])
    np.testing.assert_allclose(found.latitude_deg, [48.1, 48.10001])
    np.testing.assert_allclose(found.longitude_deg, [11.5, 11.5])
    geoid_m = egm96().height_m([48.1, 48.10001], 11.5)
    np.testing.assert_allclose(found.height_m - geoid_m, [530.2, 530.4])
    assert found.fix_class == (FixClass.SINGLE, FixClass.SINGLE)
    assert found.line.tolist() == [1, 3] and found.airborne
    assert found.skipped == (
        "heights are above the sea: EGM96's 45.5 m were added, they may be wrong by some metres",
        "1 subtitle with a repeated position skipped",
    )


def test_spellings_of_other_drones(read):
    """The Mavic 2 misspells, spaces, and gives one altitude."""
    found = read(subtitles(["[latitude : -22.5] [longtitude : 114.0] [altitude: 88.5]"]))
    assert (found.latitude_deg[0], found.longitude_deg[0]) == (-22.5, 114.0)
    assert found.height_m[0] == pytest.approx(88.5 + egm96().height_m(-22.5, 114.0))


@pytest.mark.parametrize(
    ("text", "height"),
    [
        (
            "HOME(149.0251,-20.2532) 2017.08.05 14:11:51\nGPS(149.0251,-20.2533,16) BAROMETER:1.9\nISO:100",
            16.0,
        ),
        ("F/3.5, SS 1000, ISO 100, EV 0, GPS (149.0251, -20.2533, 16), D 20.07m, H 4.30m, H.S 0.00m/s", 16.0),
        ("GPS(149.0251,-20.2533,123.4M)", 123.4 + 57.02),
        ("HOME(149.0251,-20.2532) 2017.8.5 14:11:51\nGPS(149.0251,-20.2533,16) Hb:1.9 Hs:1.9", 16.0),
    ],
)
def test_the_old_form_has_the_longitude_first(read, text, height):
    found = read(subtitles([text]))
    assert (found.latitude_deg[0], found.longitude_deg[0]) == (-20.2533, 149.0251)
    assert found.height_m[0] == pytest.approx(height, abs=0.01)


def test_old_heights_change_with_the_barometer(read):
    """Whole numbers cannot show a climb; the barometer's changes are kept at their median's level."""
    rows = [(16, 1.0), (16, 2.5), (17, 3.0)]
    found = read(subtitles([f"GPS(8.4,49.{k},{alt}) BAROMETER:{b}" for k, (alt, b) in enumerate(rows)]))
    np.testing.assert_allclose(found.height_m, [15.0, 16.5, 17.0])
    assert "counts satellites on some drones" in found.doubts[0]


def test_a_drone_that_stands_still_has_a_fix_a_second(read):
    found = read(subtitles([NEW.format(48, 11, 1, 2)] * 36, 0.1))
    np.testing.assert_allclose(found.t_s, [0, 1, 2, 3], atol=1e-9)


def test_heights_above_the_take_off_are_noted(read):
    found = read(subtitles(["[latitude: 48] [longitude: 11] [rel_alt: 3.5]"]))
    assert found.height_m[0] == 3.5
    assert found.doubts == ("heights are above the take-off point but taken as ellipsoidal",)


def test_without_heights_fixes_are_horizontal(read):
    """The Mavic 2 Pro of 2019: nothing vertical may hold the path, so the sigma is a kilometre."""
    found = read(subtitles(["[latitude : -35.08] [longtitude : -60.28] </font>"]))
    assert found.height_m[0] == 0.0
    np.testing.assert_array_equal(found.sigma_m[0], [np.nan, np.nan, 1000.0])
    assert found.skipped == ("no heights: fixes are horizontal, at height 0 with a sigma of 1000 m",)


def test_without_times_the_dates_serve(read, tmp_path):
    place = "[latitude : -20.{}] [longtitude : 149.0251] [iso : 100]"
    dates = ["2017.08.05 23:59:59,393,525,393,525", "2017.08.06 00:00:00,593,525", "2017.13.06 00:00:00,1"]
    text = "".join(f"{n}\n{date}\n{place.format(n)}\n\n" for n, date in enumerate(dates, 1))
    found = read(text)
    assert gps_format(tmp_path / "DJI_0001.SRT") == "srt"
    np.testing.assert_allclose(found.t_s, [0.0, 1.2], atol=1e-6)  # no day is in the month 13
    np.testing.assert_allclose(found.latitude_deg, [-20.1, -20.2])
    assert found.skipped[0] == "no time codes: times count from the date of the first subtitle"


# number of fixes in each file of drones and firmwares; those without a position are refused in a line
FILES = {
    "MAVIC3.srt": 62,
    "air2s.srt": 7,
    "broken_incomplete.SRT": 19,
    "broken_incomplete2.SRT": 2,
    "m2zoom.SRT": 106,
    "matrice_300.srt": 378,
    "mavic_2_style.SRT": 456,
    "mavic_2pro_new.SRT": 598,
    "mavic_air2.srt": 3,
    "mavic_mini.SRT": 117,
    "mavic_pro.SRT": 468,
    "mavic_pro_buggy.SRT": 530,
    "mix_p4rtk_mavic2pro.srt": 7,
    "old_format.SRT": 468,
    "p4_rtk.SRT": 55,
    "p4p_sample.SRT": 5,
    "broken_empty.SRT": "the file is empty",
    "broken_empty2.SRT": "not a GPS log of a known format",
    "mavic_air.SRT": "2 subtitles, none with a position",
}


@pytest.mark.parametrize("name", FILES)
def test_every_drone_s_file_is_read_or_refused(data_dir, name):
    expected = FILES[name]
    if isinstance(expected, str):
        with pytest.raises(GpsLogError, match=f"{name}: {expected}"):
            read_gps_log(data_dir / "dji_srt" / name)
        return
    found = read_gps_log(data_dir / "dji_srt" / name)
    assert len(found) == expected
    assert np.ptp(found.latitude_deg) < 0.1 and np.ptp(found.longitude_deg) < 0.1


def test_subtitles_before_the_first_fix_are_passed_over(read):
    texts = [
        "[latitude: 0.000000] [longitude: 0.000000] [abs_alt: 5]",
        "[iso : 100]",
        NEW.format(48, 11, 1, 2),
    ]
    found = read(subtitles(texts, 0.5))
    assert found.t_s.tolist() == [1.0]
    assert "2 subtitles without a position skipped" in found.skipped


def test_hours_and_a_byte_order_mark(read):
    found = read(b"\xef\xbb\xbf" + subtitles([NEW.format(48, 11, 1, 2)], start_s=3725.25).encode())
    assert found.t_s.tolist() == [3725.25]


def test_an_absurd_time_is_refused_in_one_line(read):
    text = subtitles([NEW.format(48 + k / 1000, 11, 1, 2) for k in range(3)], 0.5)
    with pytest.raises(GpsLogError, match="a subtitle at an impossible time; expected HH:MM:SS,mmm"):
        read(text.replace("00:00:00,500 -->", f"{'9' * 400}:00:00,500 -->"))


def test_text_that_is_no_subtitle_is_left_out_and_not_logged(read, caplog):
    text = subtitles([NEW.format(48, 11, 1, 2)])
    assert read("rubbish\n\n" + text + "\n\nno subtitle").t_s.tolist() == [0.0]
    assert not caplog.records


def test_a_truncated_file_keeps_what_is_whole(read):
    text = subtitles([NEW.format(48 + k / 1000, 11, 1, 2) for k in range(5)])
    found = read(text[: text.index("[latitude: 48.004")])
    assert len(found) == 4
    assert "1 subtitle without a position skipped" in found.skipped


@pytest.mark.parametrize(
    "text", [subtitles(["Hello", "[iso : 100]"]), subtitles(["GPS(n/a,n/a,n/a)"]), subtitles([""])]
)
def test_subtitles_without_positions_are_refused(read, text):
    with pytest.raises(
        GpsLogError, match=r"DJI_0001\.SRT: \d subtitles?, none with a position; expected \[latitude"
    ):
        read(text)


def test_a_latitude_beyond_90_degrees_is_dropped(read):
    with pytest.raises(GpsLogError, match="1 fix without a possible position dropped"):
        read(subtitles(["GPS(49.0,118.4,16)"]))  # latitude first


degrees = st.decimals(-89, 89, places=6)


@pytest.mark.slow
@given(
    st.lists(
        st.tuples(degrees, degrees, st.decimals(-100, 9000, places=3)), min_size=1, max_size=8, unique=True
    )
)
def test_what_is_written_comes_back(places):
    moving = [place for place in places if place[:2] != (0, 0)]
    if len({place[:2] for place in moving}) < max(len(moving), 1):
        return
    raw = read_dji_srt(
        subtitles([NEW.format(*place[:2], "1.000", place[2]) for place in moving]).encode(), "a"
    )
    got = np.array([fix[1:4] for fix in raw.fixes]).reshape(-1, 3)
    expected = np.array(moving, float).reshape(-1, 3)
    expected[:, 2] += egm96().height_m(*expected[:, :2].T)
    np.testing.assert_allclose(got, expected, atol=1e-9)


@pytest.mark.slow
@given(st.text(max_size=300))
def test_any_text_is_read_or_refused(text):
    try:
        raw = read_dji_srt(("1\n00:00:00,000 --> 00:00:01,000\n" + text).encode(), "a")
    except GpsLogError:
        return
    assert all(fix.t_s >= 0 for fix in raw.fixes)
