from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.gps_formats.gpx import read_gpx

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
    assert found.doubts == found.skipped[:1]
    assert found.doubts[0].endswith("every pose is 48 m too low")  # EGM96 in Karlsruhe


def test_heights_that_are_ellipsoidal_leave_no_doubt(tmp_path):
    named = GPX.replace("<ele>101</ele>", "<ele>101</ele><geoidheight>-3</geoidheight>")
    assert read_gpx(named.encode(), tmp_path / "gps.gpx").doubts == []
    ocean = GPX.replace('lat="49', 'lat="0').replace('lon="8.4"', 'lon="80"')  # the geoid is 100 m below
    assert "m too high" in read_gpx(ocean.encode(), tmp_path / "gps.gpx").doubts[0]


@pytest.mark.parametrize("height", ["", "<ele>0</ele>"])
def test_a_track_without_heights_has_horizontal_fixes(tmp_path, height):
    flat = GPX.replace("<ele>101</ele>", height).replace("<ele>100.5</ele>", height)
    file = tmp_path / "gps.gpx"
    file.write_text(flat.replace("<geoidheight>48.0</geoidheight>", ""))
    found = read_gps_log(file)
    assert len(found) == 2
    np.testing.assert_array_equal(found.height_m, 0.0)
    np.testing.assert_array_equal(found.sigma_m[:, 2], 1000.0)
    assert [note for note in found.doubts if note.startswith("no heights")] == list(found.doubts)


def test_a_track_without_any_fix_says_nothing_of_heights(tmp_path):
    lost = GPX.replace("dgps", "none").replace("<ele>101</ele>", "<fix>none</fix>")
    with pytest.raises(GpsLogError, match=r"no fix with a position \((?!.*height)"):
        file = tmp_path / "gps.gpx"
        file.write_text(lost)
        read_gps_log(file)


def test_an_absurd_number_of_satellites_is_unknown(tmp_path):
    raw = read_gpx(GPX.replace("<sat>9<", f"<sat>{'9' * 400}<").encode(), tmp_path / "gps.gpx")
    assert len(raw.fixes) == 2 and np.isnan(raw.fixes[0].satellites)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (GPX[:300], "damaged GPX"),
        ('<gpx version="1.1" creator="t"></gpx>', "0 track points"),
        (GPX.replace("time>", "tyme>"), "none with a time"),
    ],
)
def test_a_file_without_a_track_is_refused(tmp_path, text, told):
    file = tmp_path / "gps.gpx"
    file.write_text(text)
    with pytest.raises(GpsLogError, match=told):
        read_gps_log(file)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("2d", FixClass.SINGLE),
        ("pps", FixClass.SINGLE),
        ("dgps", FixClass.DGPS),
        ("rtk", FixClass.RTK_FIX),
        ("RTK Fixed", FixClass.RTK_FIX),
        ("rtk-float", FixClass.RTK_FLOAT),
        ("float", FixClass.RTK_FLOAT),
        ("ppp", FixClass.PPP),
        ("sbas", FixClass.SBAS),
        ("estimated", FixClass.UNKNOWN),
    ],
)
def test_classes_that_gpx_knows_and_those_of_rtk_programs(tmp_path, name, expected):
    file = tmp_path / "gps.gpx"
    file.write_text(GPX.replace("<fix>dgps", f"<fix>{name}"))
    assert read_gps_log(file).fix_class == (expected, FixClass.SINGLE)


def test_a_class_in_a_namespace_of_its_own(tmp_path):
    file = tmp_path / "gps.gpx"
    own = "<extensions><u:fix>rtk</u:fix></extensions>"
    text = GPX.replace("<fix>dgps</fix>", "").replace("</hdop>", f"</hdop>{own}")
    file.write_text(text.replace("<gpx ", '<gpx xmlns:u="urn:u" '))
    assert read_gps_log(file).fix_class[0] is FixClass.RTK_FIX


@pytest.mark.parametrize("point", ["rte><rtept", "wpt"])
def test_the_fix_of_a_route_or_a_waypoint_is_not_that_of_the_track_point_before_it(tmp_path, point):
    file = tmp_path / "gps.gpx"
    names = point.split("><")
    other = f'<{point} lat="1" lon="2"><fix>2d</fix>' + "".join(f"</{name}>" for name in names[::-1])
    file.write_text(GPX.replace("</gpx>", f"{other}</gpx>"))
    # the last point of the track says that it has none
    assert read_gps_log(file).fix_class == (FixClass.DGPS, FixClass.SINGLE)
    assert "1 point without a fix skipped" in read_gps_log(file).skipped


def test_points_without_a_fix_are_counted(tmp_path):
    file = tmp_path / "gps.gpx"
    file.write_text(GPX)
    assert "1 point without a fix skipped" in read_gps_log(file).skipped


def test_times_with_an_offset_are_put_on_utc(tmp_path):
    file = tmp_path / "gps.gpx"
    file.write_text(GPX.replace("2025-01-01T00:00:00.5Z", "2025-01-01T09:00:00.5+09:00"))
    np.testing.assert_allclose(read_gps_log(file).t_s, [0.0, 1.0])


@given(st.integers(0, len(GPX)))
def test_a_truncated_file_is_refused(cut):
    data = GPX.encode()[:cut]
    if data.rstrip().endswith(b"</gpx>"):
        assert len(read_gpx(data, "a").fixes) == 2
        return
    with pytest.raises(GpsLogError, match="damaged GPX"):
        read_gpx(data, "a")


BOMB = "".join(f'<!ENTITY {b} "{9 * f"&{a};"}">' for a, b in pairwise("abcdefghi"))


@pytest.mark.parametrize("inside", ["", f'<!ENTITY a "aa">{BOMB}', '<!ENTITY a SYSTEM "file:///etc/passwd">'])
def test_a_document_type_is_refused(tmp_path, inside):
    file = tmp_path / "gps.gpx"
    file.write_text(
        GPX.replace("<gpx", f"<!DOCTYPE gpx [{inside}]><gpx").replace("<sat>", "<name>&a;</name><sat>")
    )
    with pytest.raises(GpsLogError, match=r"damaged GPX \(it has a document type\); export the track again"):
        read_gps_log(file)
