from datetime import UTC, datetime
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.gps_formats.xml_tracks import looks_like_xml_track, read_xml_track

HERE = Path("track.xml")
TCX = """<?xml version="1.0"?>
<TrainingCenterDatabase xmlns="http://www.garmin.com/xmlschemas/TrainingCenterDatabase/v2"><Activities><Activity><Lap>
<Track><Trackpoint><Time>2024-05-01T09:30:12.000Z</Time><Position><LatitudeDegrees>49.011</LatitudeDegrees>
<LongitudeDegrees>8.4165</LongitudeDegrees></Position><AltitudeMeters>116.0</AltitudeMeters></Trackpoint>
<Trackpoint><Time>2024-05-01T09:30:13.000Z</Time><HeartRateBpm><Value>90</Value></HeartRateBpm></Trackpoint>
<Trackpoint><Time>2024-05-01T09:30:14.000Z</Time><Position><LatitudeDegrees>49.012</LatitudeDegrees>
<LongitudeDegrees>8.4165</LongitudeDegrees></Position><AltitudeMeters>117.0</AltitudeMeters></Trackpoint>
</Track></Lap></Activity></Activities></TrainingCenterDatabase>"""
KML = """<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2"><Placemark>
<gx:MultiTrack><gx:Track><altitudeMode>absolute</altitudeMode><when>2024-05-01T09:30:12Z</when>
<when>2024-05-01T11:30:13.500+02:00</when><when>2024-05-01T09:30:14Z</when>
<gx:coord>8.4165 49.011 116.0</gx:coord><gx:coord>8.4165 49.012 117.0</gx:coord><gx:coord/></gx:Track>
</gx:MultiTrack></Placemark></kml>"""
START = datetime(2024, 5, 1, 9, 30, 12, tzinfo=UTC).timestamp()
EGM96_M = 48.17  # there


@pytest.mark.parametrize(("text", "last", "step_s"), [(TCX, 3, 2.0), (KML, 2, 1.5)])
def test_a_track_with_times_is_read(tmp_path: Path, text: str, last: int, step_s: float):
    file = tmp_path / "track"
    file.write_text(text)
    assert gps_format(file) == "track" and len(read_gps_log(file)) == 2
    raw = read_xml_track(text.encode(), HERE)
    assert [fix.t_s - START for fix in raw.fixes] == [0.0, step_s]
    assert [fix.latitude_deg for fix in raw.fixes] == [49.011, 49.012]
    assert raw.fixes[0].longitude_deg == 8.4165 and raw.fixes[0].fix_class is FixClass.SINGLE
    assert raw.fixes[0].height_m == pytest.approx(116.0 + EGM96_M, abs=0.01)
    assert [fix.line for fix in raw.fixes] == [1, last]
    assert raw.notes[0] == "1 point without a time and a place skipped"
    assert raw.notes[1].startswith("heights are above the sea: EGM96's 48.2 m")


def test_a_track_on_the_ground_has_no_heights():
    raw = read_xml_track(KML.replace("116.0", "0").replace("117.0", "0").encode(), HERE)
    assert [fix.sigma_m[2] for fix in raw.fixes] == [1000.0, 1000.0]
    assert raw.doubts[0].startswith("no heights")


def test_a_kml_without_a_track_is_none():
    assert not looks_like_xml_track(b"<kml><LineString><coordinates>8,49,0</coordinates></LineString></kml>")


@pytest.mark.parametrize("text", [TCX[:400], KML[:300], KML.replace("<kml", "<!DOCTYPE k []><kml")])
def test_damaged_xml_is_refused_in_one_line(text: str):
    with pytest.raises(GpsLogError, match=r"damaged XML .*export the track again") as error:
        read_xml_track(text.encode(), HERE)
    assert "\n" not in str(error.value)


@pytest.mark.slow
@settings(deadline=None)
@given(st.sampled_from([TCX, KML]), st.lists(st.tuples(st.integers(0, 900), st.text(max_size=9)), max_size=3))
def test_any_damage_is_survived(text: str, damage: list[tuple[int, str]]):
    for at, noise in damage:
        text = text[:at] + noise + text[at + len(noise) :]
    try:
        read_xml_track(text.encode(errors="replace"), HERE)
    except GpsLogError as error:
        assert "\n" not in str(error)
