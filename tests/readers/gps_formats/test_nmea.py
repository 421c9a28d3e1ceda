from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nmea_text import gga, gst, rmc, sentence, with_checksums, zda

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, unix_s
from vgps.readers.gps_formats.nmea import looks_like_nmea, looks_like_nmea_without_gga, read_nmea


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


# a Furuno Ai-T250, gpsd's test/daemon/ait250.log
AIT250 = """$GPRMC,194907.00,A,5241.99815,N,00517.56525,E,0.005,,010809,,,A*7B\r
$GPGBS,194907.00,3.0,1.9,4.2,,,,*4E\r
$GPRMC,194908.00,A,5241.99805,N,00517.56503,E,0.003,,010809,,,A*77\r
"""


def test_rmc_alone_is_a_fix_without_a_height():
    log = read(AIT250)
    assert log.clock is Clock.UTC
    assert [fix.t_s for fix in log.fixes] == [utc(2009, 8, 1, 19, 49, 7), utc(2009, 8, 1, 19, 49, 8)]
    assert log.fixes[0].latitude_deg == pytest.approx(52.699969167, abs=1e-9)  # gpsd's
    assert log.fixes[0].longitude_deg == pytest.approx(5.292754167, abs=1e-9)
    assert [fix.height_m for fix in log.fixes] == [0.0, 0.0] and log.fixes[0].sigma_m[2] == 1000.0
    assert log.fixes[0].fix_class is FixClass.SINGLE and [fix.line for fix in log.fixes] == [1, 3]
    assert log.notes == ["no GGA with a fix: positions are those of RMC"]
    assert log.doubts == ["no heights: fixes are horizontal, at height 0 with a sigma of 1000 m"]


def test_rmc_has_no_part_where_gga_has_a_fix():
    with_rmc = read(rmc("115958", "260911") + gga("115959") + rmc("120000", "260911"))
    assert [fix.line for fix in with_rmc.fixes] == [2] and with_rmc.notes == []


@pytest.mark.parametrize(
    ("end", "expected"),
    [
        (",,,A", FixClass.SINGLE),
        (",,,D", FixClass.DGPS),
        (",,,F,V", FixClass.RTK_FLOAT),
        (",,,R,V", FixClass.RTK_FIX),
        (",,,P", FixClass.SINGLE),
        (",,", FixClass.SINGLE),  # before NMEA 2.3
        (",,,", FixClass.SINGLE),
        *[(f",,,{mode}", None) for mode in "NEMS"],
    ],
)
def test_the_mode_is_the_class_of_rmc(end, expected):
    log = read(sentence(f"GPRMC,120000,A,4900.66,N,00824.99,E,0.004,77.52,260911{end}"))
    assert [fix.fix_class for fix in log.fixes] == ([] if expected is None else [expected])


def test_rmc_with_a_warning_is_no_fix():
    assert read(rmc("120000", "260911", "V") + rmc("120001", "260911")).notes[1] == (
        "1 epoch without a fix skipped"
    )


@pytest.mark.parametrize(
    ("modes", "expected"),
    [("AN", FixClass.SINGLE), ("RRAN", FixClass.RTK_FIX), ("NDA", FixClass.DGPS), ("NN", None), ("", None)],
)
def test_gns_has_a_height_and_a_mode_of_each_constellation(modes, expected):
    place = "4900.66,N,00824.99,E"
    gns = sentence(f"GNGNS,120000.00,{place},{modes},14,0.80,116.0,47.9,1.5,0000")
    log = read(gns + rmc("120000.00", "260911"))  # which RMC does not replace
    if expected is None:
        assert log.notes[0] == "no GGA with a fix: positions are those of RMC"
    else:
        (fix,) = log.fixes
        assert (fix.fix_class, fix.hdop, fix.satellites, fix.correction_age_s) == (expected, 0.8, 14, 1.5)
        assert fix.height_m == pytest.approx(163.9)
        assert log.notes == ["no GGA with a fix: positions are those of GNS"]


def test_gll_is_read_where_there_is_nothing_else():
    place = "4900.66,N,00824.99,W"
    log = read(sentence(f"INGLL,{place},194102,A") + sentence(f"INGLL,{place},194104,V"))
    (fix,) = log.fixes
    assert log.clock is Clock.TIME_OF_DAY and fix.t_s == 19 * 3600 + 41 * 60 + 2
    assert fix.longitude_deg == pytest.approx(-8.4165) and fix.fix_class is FixClass.SINGLE
    leap = read(sentence(f"GPGLL,{place},235960.5,A,D")).fixes[0]
    assert (leap.t_s, leap.fix_class) == (86400.5, FixClass.DGPS)


def test_gga_without_heights_is_horizontal():
    bare = "GPGGA,112257.00,3844.24011,N,00908.43828,W,1,03,10.5,,,,,,"  # gpsd's test/daemon/polarx2.log
    (fix,) = read(sentence(bare)).fixes
    assert (fix.height_m, fix.sigma_m[2], fix.hdop) == (0.0, 1000.0, 10.5)


def test_an_epoch_without_time_and_fix_is_one_without_a_fix():
    assert read(gga("120000") + sentence("GPGGA,,,,,,0,,,,M,,M,,")).notes == ["1 epoch without a fix skipped"]
    assert read(gga("120000") + gga("")).notes == ["1 fix without a time of day skipped"]


def test_a_logger_may_write_times_around_a_sentence():
    text = "".join(
        f"2024-05-01 10:00:0{k}.123 {gga(f'12000{k}')}NMEA,{sentence('GPGSV,1,1,00').strip()},171455{k}\r\n"
        f"NMEA,{zda(f'12000{k}', 1, 5, 2024).strip()},171455{k}\r\n"
        for k in range(3)
    )
    log = read(text)
    assert len(log.fixes) == 3 and log.clock is Clock.UTC and log.notes == []


def test_a_place_that_is_cut_off_is_damage_even_without_checksums():
    whole = "$GPRMC,120000,A,4900.66,N,00824.99,E,0.0,0.0,260911,,,A\n"
    log = read(whole + "$GPRMC,120001,A,4900.66,N,0082")
    assert len(log.fixes) == 1 and "1 damaged or truncated line skipped, first line 2" in log.notes


@pytest.mark.slow
@given(st.binary(max_size=300))
def test_no_garbage_breaks_the_reader(data):
    assert read_nmea(data + b"\n" + gga("120000").encode()).fixes


@pytest.mark.slow
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


@pytest.mark.slow
@given(st.text(alphabet="0123456789.,-+eENSWanif*", max_size=90))
def test_any_fields_under_a_right_checksum_are_survived(fields):
    read(
        sentence("GNGGA," + fields)
        + sentence("GNZDA," + fields)
        + sentence("GNRMC," + fields)
        + sentence("GNGSA," + fields)
        + sentence("GNGNS," + fields)
        + sentence("GNGLL," + fields)
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
    assert looks_like_nmea_without_gga(AIT250.encode()) and not looks_like_nmea(AIT250.encode())
