from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nmea_text import gga, gst, rmc, sentence, with_checksums, zda

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, unix_s
from vgps.readers.gps_formats.nmea import looks_like_nmea, read_nmea


def read(text: str):
    return read_nmea(text.encode())


def utc(*parts: int) -> float:
    return unix_s(datetime(*parts, tzinfo=UTC))


def test_an_epoch_is_joined_by_its_time():
    log = read(gga("120000.50") + gst("120000.50") + zda("120000.50", 26, 9, 2011))
    (fix,) = log.fixes
    assert log.clock is Clock.UTC
    assert fix.t_s == pytest.approx(utc(2011, 9, 26, 12) + 0.5, abs=1e-6)
    assert fix.latitude_deg == pytest.approx(49 + 0.66 / 60, abs=1e-9)
    assert fix.longitude_deg == pytest.approx(8 + 24.99 / 60, abs=1e-9)
    assert fix.height_m == pytest.approx(116.0 + 47.9)
    assert fix.sigma_m == (0.01, 0.02, 0.03)
    assert (fix.hdop, fix.satellites, fix.correction_age_s) == (0.8, 14.0, 1.5)
    assert fix.fix_class is FixClass.RTK_FIX
    assert log.notes == []


def test_sigmas_of_another_epoch_are_not_taken():
    log = read(gst("120000.00") + gga("120001.00") + gga("120002.00") + gst("120002.00"))
    assert np.isnan(log.fixes[0].sigma_m).all()
    assert log.fixes[1].sigma_m == (0.01, 0.02, 0.03)


def test_south_and_west_are_negative():
    log = read(sentence("GPGGA,010203,3352.5,S,15112.25,W,1,08,1.1,10.0,M,20.0,M,,"))
    assert log.fixes[0].latitude_deg == pytest.approx(-33.875)
    assert log.fixes[0].longitude_deg == pytest.approx(-151 - 12.25 / 60)
    assert np.isnan(log.fixes[0].correction_age_s)


@pytest.mark.parametrize(
    ("quality", "expected"),
    [
        (1, FixClass.SINGLE),
        (2, FixClass.DGPS),
        (3, FixClass.SINGLE),
        (4, FixClass.RTK_FIX),
        (5, FixClass.RTK_FLOAT),
        (6, FixClass.UNKNOWN),
        (9, FixClass.SBAS),
        (17, FixClass.UNKNOWN),
    ],
)
def test_quality_is_the_class(quality, expected):
    assert read(gga("120000", quality=quality)).fixes[0].fix_class is expected


def test_epochs_without_a_fix_are_counted():
    empty = sentence("GNGGA,120001.00,,,,,0,00,99.99,,M,,M,,")
    log = read(gga("120000") + empty + gga("120002"))
    assert len(log.fixes) == 2
    assert log.notes == ["1 epoch without a fix skipped"]


@pytest.mark.parametrize("talker", ["GP", "GN", "GL", "GA", "GB", "BD", "GQ"])
def test_every_talker_is_read(talker):
    assert len(read(gga("120000", talker=talker)).fixes) == 1


def test_the_date_runs_on_over_midnight():
    log = read(gga("235959.50") + zda("235959.50", 31, 12, 2019) + gga("000000.50") + gga("000001.50"))
    times = [fix.t_s for fix in log.fixes]
    np.testing.assert_allclose(np.array(times) - utc(2020, 1, 1), [-0.5, 0.5, 1.5], atol=1e-6)


def test_a_date_that_comes_late_holds_for_what_was_before():
    log = read(gga("235958") + gga("235959") + gga("000000") + rmc("000000", "010120") + gga("000001"))
    np.testing.assert_allclose([fix.t_s - utc(2020, 1, 1) for fix in log.fixes], [-2, -1, 0, 1], atol=1e-6)


def test_a_log_resumed_days_later_takes_the_new_date_at_once():
    log = read(
        gga("100000") + zda("100000", 1, 5, 2020) + gga("100001") + gga("110000") + zda("110000", 4, 5, 2020)
    )
    expected = [utc(2020, 5, 1, 10), utc(2020, 5, 1, 10) + 1, utc(2020, 5, 4, 11)]
    np.testing.assert_allclose([fix.t_s for fix in log.fixes], expected, atol=1e-6)


def test_rmc_before_the_first_fix_gives_no_date():
    log = read(rmc("120000", "060180", "V") + gga("120000"))
    assert log.clock is Clock.TIME_OF_DAY
    assert log.fixes[0].t_s == 43200.0
    assert read(zda("120000", 31, 2, 2011) + gga("120000")).clock is Clock.TIME_OF_DAY


def test_a_leap_second_is_the_next_days_first():
    log = read(gga("235959") + zda("235959", 31, 12, 2016) + gga("235960.25") + gga("000000.50"))
    np.testing.assert_allclose([fix.t_s - utc(2017, 1, 1) for fix in log.fixes], [-1, 0.25, 0.5], atol=1e-6)


def test_gsa_gives_a_missing_hdop():
    bare = sentence("GNGGA,120000,4900.66,N,00824.99,E,4,14,,116.0,M,47.9,M,,")
    dops = sentence("GNGSA,A,3,80,71,73,79,69,,,,,,,,1.83,1.09,1.47")
    assert read(bare + dops).fixes[0].hdop == 1.09
    assert read(gga("120000") + dops).fixes[0].hdop == 0.8


def test_a_missing_separation_is_that_of_the_others():
    log = read(gga("120000") + gga("120001", separation="") + gga("120002"))
    assert [fix.height_m for fix in log.fixes] == pytest.approx([163.9] * 3)
    assert log.notes == ["1 fix without geoid separation, taken as 47.9 m as in the others"]
    log = read(gga("120000", separation=""))
    assert log.fixes[0].height_m == pytest.approx(116.0 + 48.17, abs=0.01)
    assert log.notes == [
        "1 fix without geoid separation, taken as 48.2 m from EGM96: heights may be wrong by a metre"
    ]


def test_a_separation_that_contradicts_the_geoid_is_said(data_dir):
    assert read(gga("120000", separation="45.5")).notes == []
    (note,) = read(gga("120000", separation="0.0")).notes
    assert note.startswith("the receiver's geoid separation, 0.0 m, contradicts EGM96's 48.2 m")
    # a u-blox F9P in Colorado: its table is coarse
    real = b"".join(
        line + b"\r\n"
        for line in (data_dir / "rtk_walk/gnss.ubx").read_bytes().split(b"\r\n")
        if line.startswith(b"$G")
    )
    assert any(
        "geoid separation, -21.4 m, contradicts EGM96's -16.2 m" in note for note in read_nmea(real).notes
    )


def test_damage_is_counted_and_passed_over():
    whole = gga("120000")
    text = (
        whole
        + gga("120001").replace("4900", "4910")  # checksum no longer right
        + whole[:40] + "\r\n"  # cut, without a checksum
        + "00824.99,E,4,14*7F\r\n"  # the head is lost
        + gga("120003")
        + gga("120004")[:50]
    )  # fmt: skip
    log = read(text)
    assert [fix.line for fix in log.fixes] == [1, 5]
    assert log.notes == ["4 damaged or truncated lines skipped, first line 2"]


def test_a_sentence_within_a_line_of_garbage_is_found():
    data = b"\x00\xff\xb5\x62\x01$G\n" + b"\x07noise" + gga("120000").encode() + b"\xb5\x62\x00\x00"
    assert [fix.line for fix in read_nmea(data).fixes] == [2]


def test_other_sentences_and_comments_are_no_damage():
    text = (
        "# my log\r\n"
        + sentence("GPGSV,1,1,00")
        + sentence("PUBX,00,1")
        + "!AIVDM,1,1\r\n\r\n"
        + gga("120000")
    )
    assert read(text).notes == []


def test_a_log_without_any_checksums_is_read():
    text = "".join(gga(f"12000{i}").split("*")[0] + "\n" for i in range(3)) + "$GNGGA,120003,4900.66,N"
    log = read(text)
    assert len(log.fixes) == 3
    assert log.notes == ["1 damaged or truncated line skipped, first line 4"]


@given(st.binary(max_size=300))
def test_no_garbage_breaks_the_reader(data):
    assert read_nmea(data + b"\n" + gga("120000").encode()).fixes


@given(
    st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 255)), max_size=12),
    st.integers(0, 2000),
)
def test_damage_never_yields_a_wrong_fix(changes, length):
    """Any bytes overwritten, any end cut off: what remains is as it was written, or it is left out."""
    data = bytearray(
        "".join(
            gga(f"1200{i:02}") + gst(f"1200{i:02}") + zda(f"1200{i:02}", 26, 9, 2011) for i in range(10)
        ).encode()
    )
    for place, byte in changes:
        data[place % len(data)] = byte
    log = read_nmea(bytes(data[:length]))
    for fix in log.fixes:
        # a checksum of 8 bits lets two changed characters of the same bit through; one never
        if len(changes) <= 1:
            assert fix.height_m == pytest.approx(163.9)
            assert fix.latitude_deg == pytest.approx(49.011, abs=1e-6)


@given(st.text(alphabet="0123456789.,-+eENSWanif*", max_size=90))
def test_any_fields_under_a_right_checksum_are_survived(fields):
    read(
        sentence("GNGGA," + fields)
        + sentence("GNZDA," + fields)
        + sentence("GNRMC," + fields)
        + sentence("GNGSA," + fields)
    )


def test_absurd_numbers_are_damage():
    many = gga("120001").replace(",14,0.80", f",{'9' * 400},0.80")
    year = zda("120002", 26, 9, 99_999_999_999)
    log = read(gga("120000") + with_checksums(many) + gga("120002") + year)
    assert [fix.line for fix in log.fixes] == [1, 3]
    assert log.notes == ["1 damaged or truncated line skipped, first line 2"]
    assert log.clock is Clock.TIME_OF_DAY  # a year without a calendar is no date


def test_what_looks_like_nmea():
    assert looks_like_nmea(gga("120000").encode())
    assert not looks_like_nmea(b"$GNGSV,1\nt_s,latitude_deg\n")
