from dataclasses import replace
from datetime import UTC, datetime

import pytest
from solutions import minute_drive

from vgps.config import Config
from vgps.crs import coordinate_system
from vgps.report.survey_facts import changed_settings, class_spells, datum_facts


def test_datum_and_epoch_are_stated():
    run = replace(minute_drive(), video_start_utc=datetime(2026, 7, 2, 12, tzinfo=UTC))
    system = coordinate_system(run.world_origin[:2], "EPSG:32632", "egm96")
    facts = dict(datum_facts(run, system))
    assert facts["coordinate system"] == "WGS 84 / UTM zone 32N (EPSG:32632)"
    assert facts["heights"] == "height above the geoid EGM96"
    # 100 m above the ellipsoid, where EGM96 is 48.2 m high
    assert facts["origin"] == "easting 426857.988 m, northing 5427937.523 m, height 51.770 m"
    assert facts["EGM96 at the origin"] == "48.23 m above the ellipsoid"
    assert facts["epoch"] == "2026-07-02 12:00:00 UTC, 2026.500"


def test_a_run_without_place_and_time_says_so():
    facts = dict(datum_facts(replace(minute_drive(), video_start_utc=None), None))
    assert facts == {"epoch": "unknown: the recording does not say when it began"}


def test_spells_of_classes():
    spells = class_spells(minute_drive())
    counts = [(name, count) for name, _, _, count in spells]
    assert counts == [("rtk_fix", 9), ("rtk_float", 27), ("unknown", 6)]
    # the time offset of 0.125 s is removed
    assert spells[0][1:3] == pytest.approx((-0.075, 7.925))


def test_settings_that_differ_from_the_defaults():
    assert changed_settings(Config().model_dump(mode="json")) == []
    config = Config().with_gps("ellipsoid").model_dump(mode="json")
    assert changed_settings(config) == [("gps.model", "ellipsoid", "cylinder")]
