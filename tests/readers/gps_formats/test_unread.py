import pytest

from vgps.readers.gps_formats.unread import remedy

RTCM = b"\xd3\x00\x02ab123" * 3
UBX_RAW = (b"\xb5\x62\x02\x15\x10\x00" + bytes(18)) * 5


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (
            b"     2.10           OBSERVATION DATA    G (GPS)    RINEX VERSION / TYPE\n",
            "RINEX has raw",
        ),
        (
            b"1.0                 COMPACT RINEX FORMAT    CRINEX VERS   / TYPE\n",
            "RINEX has raw",
        ),
        (b"JP055RLOGF JPS Data", "a Javad or Topcon file"),
        (b"$@\x00\x00", "SBF without PVTGeodetic; enable that block"),
        (b"\xaaD\x12\x1c", "NovAtel without BESTPOS; log BESTPOS"),
        (b"noise" + RTCM, "RTCM 3 has corrections or raw measurements, no positions; compute"),
        (UBX_RAW, "UBX with raw measurements and without NAV-PVT; enable"),
        (b"\xb5\x62\x01\x03" * 9, "UBX without NAV-PVT; enable"),
        (b'<kml xmlns="http://www.opengis.net/kml/2.2"><LineString>', "this KML has no times"),
        (b'{"class":"TPV","mode":3}', "gpsd's JSON is not read; record NMEA"),
        (b'{"semanticSegments": []}', "Google's timeline"),
        (b"PK\x03\x04\x00", "an archive (zip, KMZ, gz)"),
        (b"\xa0\xa2\x00\x29", "a binary file; if it is a receiver's"),
    ],
)
def test_a_file_that_is_not_read_is_named_with_a_remedy(data, expected):
    found = remedy(data)
    assert found is not None and found.startswith(expected) and "\n" not in found


@pytest.mark.parametrize("data", [b"hello", b"\xd3", b"\xb5\x62" + b"a" * 5000])
def test_what_is_not_known_gets_no_guess(data):
    assert remedy(data) is None


def test_frames_of_rtcm_are_whole_and_several():
    assert all("RTCM" not in str(remedy(cut)) for cut in (RTCM[:-8], RTCM[:-1], RTCM[1:]))
