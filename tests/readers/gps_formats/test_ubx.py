import struct
from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyubx2 import GET, UBXMessage

from vgps.errors import GpsLogError
from vgps.model import FixClass, Rig
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.gps_formats.ubx import read_old_ubx, read_ubx

MOMENT = {"year": 2024, "month": 12, "day": 31, "hour": 23, "min": 59, "second": 59, "nano": 500_000_000}
NEXT = {"year": 2025, "month": 1, "day": 1, "hour": 0, "min": 0, "second": 0, "nano": 500_000_000}


def pvt(**changes):
    """A NAV-PVT message as a receiver sends it."""
    fields = {
        **MOMENT,
        "validDate": 1,
        "validTime": 1,
        "fullyResolved": 1,
        "fixType": 3,
        "gnssFixOk": 1,
        "carrSoln": 2,
        "diffSoln": 1,
        "numSV": 17,
        "lon": 8.4,
        "lat": 49.0,
        "height": 123_456,
        "hAcc": 14,
        "vAcc": 10,
    }
    return UBXMessage("NAV", "NAV-PVT", GET, **{**fields, **changes}).serialize()


def log(tmp_path, data):
    file = tmp_path / "gps.ubx"
    file.write_bytes(data)
    return file


def test_times_classes_places_and_accuracies_of_messages(tmp_path):
    file = log(tmp_path, pvt() + pvt(second=60, nano=-1000, carrSoln=1) + pvt(min=58, carrSoln=0))
    found = read_gps_log(file)
    assert gps_format(file) == "ubx"
    assert found.fix_class == (FixClass.DGPS, FixClass.RTK_FIX, FixClass.RTK_FLOAT)
    np.testing.assert_allclose(found.t_s, [0.0, 60.0, 60.499999])
    assert (found.latitude_deg[0], found.longitude_deg[0], found.height_m[0]) == (49.0, 8.4, 123.456)
    np.testing.assert_allclose(found.sigma_m[0], [0.0099, 0.0099, 0.010], atol=1e-4)
    assert found.satellites[0] == 17


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"carrSoln": 0, "diffSoln": 0}, FixClass.SINGLE),
        ({"carrSoln": 0, "diffSoln": 1}, FixClass.DGPS),
        ({"carrSoln": 0, "fixType": 1}, FixClass.UNKNOWN),
    ],
)
def test_without_a_carrier_solution_corrections_tell_the_class(tmp_path, changes, expected):
    found = read_gps_log(log(tmp_path, pvt() + pvt(second=30, **changes)))
    assert expected in found.fix_class


def test_what_is_no_fix_is_passed_over_and_damage_too(tmp_path):
    damaged = bytearray(pvt(second=20))
    damaged[30] ^= 0xFF
    data = b"$GNTXT,hello*00\r\n" + pvt(gnssFixOk=0) + pvt(validTime=0) + bytes(damaged) + pvt()
    found = read_gps_log(log(tmp_path, data))
    assert len(found) == 1
    assert any("without a fix" in note for note in found.skipped)
    assert any("knew the time" in note for note in found.skipped)


def test_a_stream_cut_in_the_middle_keeps_what_is_whole(tmp_path):
    assert len(read_gps_log(log(tmp_path, pvt() + pvt(second=30)[:40]))) == 1


def test_ubx_without_positions_is_refused(tmp_path):
    other = UBXMessage("NAV", "NAV-STATUS", GET).serialize()
    with pytest.raises(GpsLogError, match="UBX without NAV-PVT"):
        read_gps_log(log(tmp_path, other * 50))


@pytest.mark.slow
def test_the_real_walk_is_the_same_in_three_formats(data_dir, tmp_path):
    walk = data_dir / "rtk_walk"
    ubx, pos = read_gps_log(walk / "gnss.ubx"), read_gps_log(walk / "gnss.pos")
    text = [line for line in (walk / "gnss.ubx").read_bytes().split(b"\r\n") if b"$GN" in line]
    sentences = [line[line.index(b"$GN") :] for line in text]
    (tmp_path / "gps.nmea").write_bytes(b"\r\n".join(sentences) + b"\r\n")
    nmea = read_gps_log(tmp_path / "gps.nmea")
    for other in (pos, nmea):
        assert len(other) == len(ubx) == 536 and ubx.skipped == ()
        assert other.fix_class == ubx.fix_class and ubx.fix_class.count(FixClass.RTK_FIX) == 349
        assert ubx.fix_class.count(FixClass.RTK_FLOAT) == 187
        np.testing.assert_allclose(other.latitude_deg, ubx.latitude_deg, atol=1.1e-7)
        np.testing.assert_allclose(other.longitude_deg, ubx.longitude_deg, atol=1.1e-7)
        np.testing.assert_allclose(np.diff(other.t_s), np.diff(ubx.t_s), atol=0.002)
    np.testing.assert_allclose(nmea.height_m, ubx.height_m, atol=0.002)
    # this .pos was written with heights above the geoid
    np.testing.assert_allclose(pos.height_m - ubx.height_m, 21.387, atol=0.002)


def framed(kind: int, payload: bytes) -> bytes:
    """A message of class NAV, with its Fletcher checksum."""
    body = bytes([1, kind]) + struct.pack("<H", len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) % 256
        b = (b + a) % 256
    return b"\xb5\x62" + body + bytes([a, b])


def hpposllh(tow_ms: int, invalid: int = 0) -> bytes:
    """8.400000012, 48.999999966 degrees, 123.4565 m, 14.1 and 10.2 mm."""
    fields = (0, 0, invalid, tow_ms, 84_000_000, 490_000_000, 123_456, 100_000, 12, -34, 5, 0, 141, 102)
    return framed(0x14, struct.pack("<BHBIiiiibbbbII", *fields))


def dop(tow_ms: int, hundredths: int) -> bytes:
    return framed(0x04, struct.pack("<I7H", tow_ms, 300, 280, 100, 200, hundredths, 90, 80))


def at(tow_ms: int, **changes) -> bytes:
    """NAV-PVT of a time of week; the builder of messages would take a time of day."""
    payload = struct.pack("<I", tow_ms) + pvt(**changes)[10:-2]
    return framed(0x07, payload)


@pytest.mark.parametrize("first", [True, False])
def test_a_precise_position_of_the_same_epoch_replaces_the_coarse_one(tmp_path, first):
    pair = [hpposllh(1000), at(1000, pDOP=1.9)]
    parts = [*(pair if first else pair[::-1]), dop(1000, 120), at(2000, **NEXT, pDOP=1.9), hpposllh(3000)]
    found = read_gps_log(log(tmp_path, b"".join(parts)))
    np.testing.assert_allclose(found.longitude_deg, [8.400000012, 8.4], atol=1e-12, rtol=0)
    np.testing.assert_allclose(found.latitude_deg, [48.999999966, 49.0], atol=1e-12, rtol=0)
    np.testing.assert_allclose(found.height_m, [123.4565, 123.456], atol=1e-9)
    np.testing.assert_allclose(found.sigma_m[0], [0.0141 / 2**0.5, 0.0141 / 2**0.5, 0.0102])
    # HDOP where NAV-DOP tells it, else PDOP
    np.testing.assert_allclose(found.hdop, [1.2, 1.9])


def test_a_precise_position_that_is_invalid_is_left(tmp_path):
    found = read_gps_log(log(tmp_path, at(1000) + hpposllh(1000, invalid=1)))
    assert found.longitude_deg[0] == 8.4


def test_the_time_of_week_may_restart_within_a_log(tmp_path):
    """The same time of week a week later is another epoch; the date carries the time on."""
    later = {"year": 2025, "month": 1, "day": 7}
    data = at(604_799_500) + at(604_799_500, **later) + at(500, **{**NEXT, "day": 8})
    found = read_gps_log(log(tmp_path, at(500, day=24) + data + hpposllh(500)))
    np.testing.assert_allclose(found.t_s / 86400, [0, 7, 14, 14 + 1 / 86400], atol=1e-9)
    assert found.longitude_deg.tolist() == [8.4, 8.4, 8.4, 8.400000012]


def test_midnight_of_a_new_year(tmp_path):
    rig = Rig(video_start_utc=datetime(2025, 1, 1, tzinfo=UTC))
    after = pvt(**{**NEXT, "nano": 250_000_000})
    np.testing.assert_allclose(read_gps_log(log(tmp_path, pvt() + after), rig).t_s, [-0.5, 0.25], atol=1e-6)


def test_times_before_the_leap_seconds_are_known_are_noted(tmp_path):
    found = read_gps_log(log(tmp_path, pvt(fullyResolved=0)))
    assert found.skipped == (
        "1 fix before the receiver knew the leap seconds: times may be wrong by whole seconds",
    )


@pytest.mark.parametrize("kind", [0x07, 0x14, 0x04])
@pytest.mark.parametrize("length", [0, 3, 6, 17])
def test_a_message_that_is_too_short_is_damage(tmp_path, kind, length):
    """Its checksum holds; what it lacks would be zero, its position on the equator."""
    short = framed(kind, bytes(range(length)))
    found = read_gps_log(log(tmp_path, at(1000) + short))
    assert len(found) == 1 and found.skipped == ("1 damaged message skipped",)


def test_a_position_that_is_cut_off_is_no_fix(tmp_path):
    cut = framed(0x07, pvt(second=30)[6:-2][:24])
    assert len(read_gps_log(log(tmp_path, pvt() + cut))) == 1


@pytest.mark.parametrize(
    "date", [{"month": 0}, {"day": 0}, {"month": 2, "day": 30}, {"year": 0}, {"hour": 24}]
)
def test_a_date_that_is_in_no_calendar_is_no_time(tmp_path, date):
    found = read_gps_log(log(tmp_path, pvt() + pvt(**date)))
    assert len(found) == 1
    assert found.skipped == ("1 message before the receiver knew the time skipped",)


def test_damage_is_counted(tmp_path):
    damaged = bytearray(pvt(second=20))
    damaged[30] ^= 0xFF
    assert read_gps_log(log(tmp_path, pvt() + bytes(damaged))).skipped == ("1 damaged message skipped",)


@pytest.mark.slow
@given(st.lists(st.binary(max_size=40), max_size=6), st.integers(1, 4))
def test_what_stands_between_the_messages_does_not_matter(between, count):
    messages = [pvt(second=second) for second in range(count)]
    noise = [part.replace(b"\xb5", b"") for part in between] + [b""] * (count + 1)
    data = noise[0] + b"".join(m + n for m, n in zip(messages, noise[1:], strict=False))
    assert [fix.line for fix in read_ubx(data).fixes] == list(range(1, count + 1))


@given(st.integers(0, 99), st.integers(1, 255))
def test_a_byte_that_is_wrong_never_gives_a_wrong_fix(place, change):
    """Every byte of a message is under its checksum; without its head it is no message."""
    data = bytearray(pvt())
    data[place] ^= change
    assert read_ubx(bytes(data)).fixes == []


# a NEO-M8T: gpsd's test/daemon/ublox-neo-m8t.log, which it reads as below
NAV_SOL = bytes.fromhex(
    "b56201063400a06617190b110000e80703ddfe24c7f155369fe8a9c74f1aa500000001000000"
    "01000000ffffffff02000000ad0002094a6403002f17"
)
SOL = {"iTOW": 421_000_500, "week": 2024, "gpsFix": 3, "gpsfixOK": 1, "wknSet": 1, "towSet": 1, "numSV": 9}
AT_EQUATOR = {"ecefX": 637_813_700 + 10_000, "ecefY": 0, "ecefZ": 0}  # 100 m high


def sol(**changes):
    """A NAV-SOL message as an older receiver sends it."""
    fields = {**SOL, **AT_EQUATOR, "pDOP": 1.5, **changes}
    return UBXMessage("NAV", "NAV-SOL", GET, **fields).serialize()


def test_an_older_receiver_has_nav_sol(tmp_path):
    file = log(tmp_path, b"# Chipset: u-blox\n" + NAV_SOL)
    assert gps_format(file) == "ubx"
    (fix,) = read_old_ubx(file.read_bytes()).fixes
    assert fix.t_s == pytest.approx(datetime(2018, 10, 25, 20, 55, 46, tzinfo=UTC).timestamp(), abs=1e-4)
    assert fix[1:4] == pytest.approx((44.068809596, -121.314309171, 1110.6751), abs=1e-3)
    assert (fix.fix_class, fix.hdop, fix.satellites) == (FixClass.SINGLE, 1.73, 9)


def test_posllh_and_dop_of_the_epoch_refine_nav_sol():
    fields = {"lon": 0.0, "lat": 1e-7, "height": 100_004, "hAcc": 2000, "vAcc": 3000}
    place = UBXMessage("NAV", "NAV-POSLLH", GET, iTOW=SOL["iTOW"], **fields).serialize()
    dop = UBXMessage("NAV", "NAV-DOP", GET, iTOW=SOL["iTOW"], hDOP=0.9).serialize()
    first, second = read_old_ubx(place + sol() + dop + sol(iTOW=SOL["iTOW"] + 1000, diffSoln=1)).fixes
    assert (first.latitude_deg, first.height_m, first.hdop) == (1e-7, 100.004, 0.9)
    assert first.sigma_m == pytest.approx((2**0.5, 2**0.5, 3.0))
    assert (second.height_m, second.hdop) == (pytest.approx(100.0), 1.5) and np.isnan(second.sigma_m).all()
    assert second.t_s - first.t_s == pytest.approx(1.0) and second.fix_class is FixClass.DGPS


@pytest.mark.parametrize("changes", [{"gpsfixOK": 0}, {"wknSet": 0}, {"towSet": 0}])
def test_nav_sol_without_a_fix_or_time_is_none(changes):
    assert read_old_ubx(sol(**changes)).fixes == []
    assert read_old_ubx(sol(gpsFix=5)).fixes[0].fix_class is FixClass.UNKNOWN


def test_nav_sol_has_no_part_where_nav_pvt_is(tmp_path):
    assert read_gps_log(log(tmp_path, sol() + pvt())).satellites.tolist() == [17]


@given(st.integers(0, 59), st.integers(1, 255))
def test_a_nav_sol_with_a_wrong_byte_is_no_fix(place, change):
    data = bytearray(NAV_SOL)
    data[place] ^= change
    assert read_old_ubx(bytes(data)).fixes == []
