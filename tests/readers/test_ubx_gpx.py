import numpy as np
import pytest
from pyubx2 import GET, UBXMessage

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps import gps_format, read_gps_log

MOMENT = {"year": 2024, "month": 12, "day": 31, "hour": 23, "min": 59, "second": 59, "nano": 500_000_000}


def pvt(**changes):
    """A NAV-PVT message as a receiver sends it."""
    fields = {
        **MOMENT,
        "validDate": 1,
        "validTime": 1,
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


def test_a_message_by_hand(tmp_path):
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
def test_classes(tmp_path, changes, expected):
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


def test_ubx_without_positions_is_told(tmp_path):
    other = UBXMessage("NAV", "NAV-STATUS", GET).serialize()
    with pytest.raises(GpsLogError, match="UBX without NAV-PVT"):
        read_gps_log(log(tmp_path, other * 50))


def test_the_real_walk_is_the_same_three_ways(data_dir, tmp_path):
    walk = data_dir / "rtk_walk"
    ubx, pos = read_gps_log(walk / "gnss.ubx"), read_gps_log(walk / "gnss.pos")
    text = [line for line in (walk / "gnss.ubx").read_bytes().split(b"\r\n") if b"$GN" in line]
    sentences = [line[line.index(b"$GN") :] for line in text]
    (tmp_path / "gps.nmea").write_bytes(b"\r\n".join(sentences) + b"\r\n")
    nmea = read_gps_log(tmp_path / "gps.nmea")
    for other in (pos, nmea):
        assert len(other) == len(ubx) == 536
        assert other.fix_class == ubx.fix_class and ubx.fix_class.count(FixClass.RTK_FIX) == 349
        np.testing.assert_allclose(other.latitude_deg, ubx.latitude_deg, atol=1.1e-7)
        np.testing.assert_allclose(other.longitude_deg, ubx.longitude_deg, atol=1.1e-7)
        np.testing.assert_allclose(np.diff(other.t_s), np.diff(ubx.t_s), atol=0.002)
    np.testing.assert_allclose(nmea.height_m, ubx.height_m, atol=0.002)
    # this .pos was written with heights above the geoid
    np.testing.assert_allclose(pos.height_m - ubx.height_m, 21.387, atol=0.002)


GPX = """<?xml version="1.0"?><gpx version="1.1" creator="t" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="49.0" lon="8.4"><ele>100.5</ele><time>2024-12-31T23:59:59.5Z</time><geoidheight>48.0</geoidheight>
<fix>dgps</fix><sat>9</sat><hdop>1.2</hdop></trkpt>
<trkpt lat="49.1" lon="8.4"><ele>101</ele><time>2025-01-01T00:00:00.5Z</time></trkpt>
<trkpt lat="49.2" lon="8.4"><ele>101</ele></trkpt>
<trkpt lat="49.3" lon="8.4"><time>2025-01-01T00:00:01.5Z</time><fix>none</fix></trkpt>
</trkseg></trk></gpx>"""


def test_gpx_by_hand(tmp_path):
    file = tmp_path / "gps.gpx"
    file.write_text(GPX)
    found = read_gps_log(file)
    assert gps_format(file) == "gpx"
    np.testing.assert_allclose(found.t_s, [0.0, 1.0])
    np.testing.assert_allclose(found.height_m, [148.5, 101.0])
    assert found.fix_class == (FixClass.DGPS, FixClass.SINGLE)
    assert (found.satellites[0], found.hdop[0]) == (9, 1.2) and np.isnan(found.hdop[1])
    assert any("without a time" in note for note in found.skipped)
    assert any("geoidheight" in note for note in found.skipped)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (GPX[:300], "damaged GPX"),
        ('<gpx version="1.1" creator="t"></gpx>', "0 track points"),
        (GPX.replace("time>", "tyme>"), "none with a time"),
    ],
)
def test_what_is_no_track_is_told(tmp_path, text, told):
    file = tmp_path / "gps.gpx"
    file.write_text(text)
    with pytest.raises(GpsLogError, match=told):
        read_gps_log(file)
