from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.model import FixClass
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.gps_formats.android import looks_like_android, read_android

# the columns as Google's GnssLogger names them
NEW = """# Header Description:
# Raw,utcTimeMillis,TimeNanos,Svid
# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,BearingDegrees,\
UnixTimeMillis,SpeedAccuracyMps,BearingAccuracyDegrees,elapsedRealtimeNanos,VerticalAccuracyMeters,MockLocation
Fix,GPS,69.3,16.0,120.5,0,3,0,1726045923200,0.1,,123,4.5,0
Raw,1726045923000,100,5
Fix,FLP,69.9,16.0,120.5,0,3,0,1726045923500,0.1,,123,4.5,0
Fix,GPS,69.4,-16.1,121.0,0,,0,1726045924200,0.1,,124,,0
"""
OLD = "# \n# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n# \n"
OLD += "Fix,gps,37.422541,-122.081659,-33.000000,0.000000,3.000000,1467321969000\n"


def test_the_receivers_fixes_are_read(tmp_path: Path):
    file = tmp_path / "gnss_log.txt"
    file.write_text(NEW)
    found = read_gps_log(file)
    assert gps_format(file) == "android"
    np.testing.assert_allclose(found.t_s, [0.0, 1.0])
    assert found.latitude_deg.tolist() == [69.3, 69.4] and found.longitude_deg.tolist() == [16.0, -16.1]
    assert found.height_m.tolist() == [120.5, 121.0]
    assert found.fix_class == (FixClass.SINGLE, FixClass.SINGLE) and found.line.tolist() == [4, 7]
    np.testing.assert_allclose(found.sigma_m[0], [3 / 2**0.5, 3 / 2**0.5, 4.5])
    assert np.isnan(found.sigma_m[1]).all()
    assert found.skipped == ("1 fix of other providers skipped",)


def test_older_apps_have_the_time_elsewhere():
    (fix,) = read_android(OLD.encode()).fixes
    assert (fix.t_s, fix.height_m) == (1467321969.0, -33.0) and np.isnan(fix.sigma_m[2])


def test_fused_places_are_read_where_there_are_no_others():
    text = NEW.replace("Fix,GPS", "Fix,NLP")
    (fix,) = read_android(text.encode()).fixes
    assert fix.latitude_deg == 69.9
    assert read_android(text.replace("Fix,FLP", "Fix,NLP").encode()).fixes == []


def test_damage_is_counted():
    text = NEW + "Fix,GPS,not-a-number,16.0,120.5,0,3,0,1726045925000\nFix,GPS,69.3\n"
    assert read_android(text.encode()).notes[0] == "2 damaged or truncated lines skipped, first line 8"


def test_only_a_header_with_its_lines_is_such_a_log():
    assert looks_like_android(OLD.encode())
    assert not looks_like_android(OLD.partition("Fix,gps")[0].encode())
    assert not looks_like_android(b"Fix,lat,lon\nFix,1,2\n")


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(0, len(NEW)), st.text(max_size=20)), max_size=4))
def test_any_damage_is_survived(damage: list[tuple[int, str]]):
    text = NEW
    for at, noise in damage:
        text = text[:at] + noise + text[at:]
    if looks_like_android(text.encode(errors="replace")):
        read_android(text.encode(errors="replace"))


@pytest.mark.parametrize("number", ["9" * 400, "nan", "inf", "-1e308", ""])
def test_absurd_numbers_are_survived(number: str):
    for field in ("69.3", "120.5", "1726045923200", "4.5"):
        read_android(NEW.replace(field, number, 1).encode())
