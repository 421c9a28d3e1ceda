from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vgps.errors import GpsLogError
from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Clock, unix_s
from vgps.readers.gps_formats.gps_csv import looks_like_gps_csv, read_gps_csv

INSTANT_S = unix_s(datetime(2024, 5, 6, 7, 8, 9, 250000, UTC))


def read(folder: Path, text: str):
    path = folder / "gps.csv"
    path.write_text(text)
    return read_gps_csv(path)


def test_every_column(tmp_path):
    (fix,) = read(
        tmp_path,
        "satellites,t_s,longitude_deg,latitude_deg,height_m,fix_class,note,sigma_up_m,sigma_east_m,sigma_north_m,"
        "hdop,correction_age_s\n17,1.5,8.1,49.2,100.5,rtk_float,tree,0.3,0.1,0.2,0.8,2.5\n",
    ).fixes
    assert fix[:6] == (1.5, 49.2, 8.1, 100.5, FixClass.RTK_FLOAT, 2)
    assert fix.sigma_m == (0.1, 0.2, 0.3)
    assert (fix.hdop, fix.satellites, fix.correction_age_s) == (0.8, 17, 2.5)


def test_other_names_separators_and_comments(tmp_path):
    text = "# my receiver\n\nTime_S;LAT;Lon;Height;Fix\n0.5; 49.2;8.1;100.5;4\n\n# pause\n1.5;49.2;8.1;;1\n"
    first, second = read(tmp_path, text).fixes
    assert first[:6] == (0.5, 49.2, 8.1, 100.5, FixClass.RTK_FIX, 4)
    assert np.isnan(second.height_m)
    assert second.line == 7


def test_names_that_loggers_use(tmp_path):
    text = "time_utc,gps_latitude,long,elevation,undulation_m,fix_quality,num_sats,age_s,std_east_m\n"
    (fix,) = read(tmp_path, text + "2024-05-06T07:08:09.25Z,49.2,8.1,100.5,48,5,17,1.5,0.2\n").fixes
    assert fix[:6] == (INSTANT_S, 49.2, 8.1, 148.5, FixClass.RTK_FLOAT, 2)
    assert (fix.satellites, fix.correction_age_s, fix.sigma_m[0]) == (17, 1.5, 0.2)


@pytest.mark.parametrize("name", ["fix_type", "status", "fixtype"])
def test_numbers_of_another_meaning_are_not_taken_for_the_class(tmp_path, name):
    """u-blox's fixType 4 is dead reckoning, NMEA's quality 4 is RTK-fix."""
    with pytest.raises(GpsLogError, match="no column fix_class"):
        read(tmp_path, f"t_s,lat,lon,height,{name}\n0,49,8,100,4\n")


@pytest.mark.parametrize(
    ("name", "cell"),
    [
        ("utc", "2024-05-06T07:08:09.25Z"),
        ("timestamp", "2024-05-06 07:08:09.25"),
        ("datetime", "2024-05-06T09:08:09.250+02:00"),
        ("unix_s", f"{INSTANT_S:.2f}"),
        ("timestamp", f"{INSTANT_S * 1e3:.0f}"),
        ("time", f"{INSTANT_S * 1e6:.0f}"),
        ("%time", "1714979289250000000"),
    ],
)
def test_every_form_of_utc(tmp_path, name, cell):
    log = read(tmp_path, f"{name},lat,lon,height,quality\n{cell},49,8,100,4\n")
    assert log.clock is Clock.UTC
    assert log.fixes[0].t_s == pytest.approx(INSTANT_S, abs=1e-6)


def test_a_bare_time_of_small_numbers_is_the_videos_clock(tmp_path):
    log = read(tmp_path, "time,lat,lon,height,quality\n3.5,49,8,100,4\n")
    assert (log.clock, log.fixes[0].t_s) == (Clock.VIDEO, 3.5)


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        ("RTK Fix", "rtk_fix"),
        ("rtk-float", "rtk_float"),
        ("Fixed", "rtk_fix"),
        ("5.0", "rtk_float"),
        ("sbas", "sbas"),
        ("3D", "single"),
        ("ppp", "ppp"),
        ("what", "unknown"),
        ("0", None),
        ("none", None),
        ("", None),
        ("nan", None),
    ],
)
def test_class_names_and_numbers(tmp_path, cell, expected):
    fixes = read(tmp_path, f"t_s,lat,lon,height,class\n1,49,8,100,{cell}\n").fixes
    assert [fix.fix_class for fix in fixes] == ([expected] if expected else [])


def test_altitude_with_and_without_separation(tmp_path):
    log = read(tmp_path, "t_s,lat,lon,altitude,separation_m,fix\n1,49,8,100,47.5,4\n")
    assert (log.fixes[0].height_m, log.notes) == (147.5, [])
    log = read(tmp_path, "t_s,lat,lon,altitude,fix\n1,49,8,100,4\n")
    assert log.fixes[0].height_m == pytest.approx(148.23, abs=0.01)
    assert log.notes == [
        "heights are above the sea: EGM96's 48.2 m were added, they may be wrong by some metres"
    ]


@pytest.mark.parametrize(
    ("name", "cells"), [("", ("", "")), (",height_m", (",0", ",0.0")), (",altitude", (",0", ","))]
)
def test_a_log_without_heights_is_horizontal(tmp_path, name, cells):
    rows = "".join(f"{t_s},49,8,4{cell}\n" for t_s, cell in enumerate(cells))
    log = read(tmp_path, f"t_s,latitude,longitude,fix{name}\n{rows}")
    assert [(fix.height_m, fix.sigma_m[2]) for fix in log.fixes] == [(0.0, 1000.0)] * 2
    assert log.notes == [] and "no heights" in log.doubts[0]


@pytest.mark.parametrize(
    ("header", "row"),
    [
        (  # Sensor Logger
            "time,seconds_elapsed,verticalAccuracy,horizontalAccuracy,altitudeAboveMeanSeaLevel,altitude,longitude,"
            "latitude",
            "1700000000500000000,3.5,4,2.5,100,148.2,8,49",
        ),
        (  # GPSLogger
            "time,lat,lon,elevation,accuracy,satellites,vertical_accuracy",
            "2023-11-14T22:13:20.500Z,49,8,100,2.5,7,4",
        ),
    ],
)
def test_loggers_of_phones_know_accuracies_instead_of_classes(tmp_path, header, row):
    log = read(tmp_path, f"{header}\n{row}\n")
    (fix,) = log.fixes
    assert fix.fix_class is FixClass.SINGLE and fix.t_s == pytest.approx(1_700_000_000.5)
    assert fix.height_m == pytest.approx(148.23, abs=0.01)
    np.testing.assert_allclose(fix.sigma_m, [2.5 / np.sqrt(2.0), 2.5 / np.sqrt(2.0), 4.0])
    assert "all count as single" in log.notes[1]


@pytest.mark.parametrize("name", ["fix_type", "status", "fix_clas"])
def test_accuracies_replace_no_class_that_the_receiver_may_know(tmp_path, name):
    with pytest.raises(GpsLogError, match="no column fix_class"):
        read(tmp_path, f"t_s,lat,lon,height,h_acc,{name}\n1,49,8,100,0.01,4\n")


def test_units_may_stand_behind_names(tmp_path):
    header = "Time (s),Latitude (°),Longitude (°),Height (m),Horizontal Accuracy (m),Vertical Accuracy (m)"
    log = read(tmp_path, f"{header}\n3.5,49,8,100,2.5,4\n")
    assert (log.clock, log.fixes[0].t_s, log.fixes[0].height_m) == (Clock.VIDEO, 3.5, 100.0)
    assert log.fixes[0].sigma_m[2] == 4.0
    with pytest.raises(GpsLogError, match="no column longitude_deg"):
        read(tmp_path, "t_s,lat,lon (rad),fix,height\n0,0.8,0.1,4,0\n")


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("t_s,latitude_degg,lon,height,fix", "no column latitude_deg .* did you mean latitude_degg"),
        ("t_s,lat,lon,hight,fix", "no column height_m .* did you mean hight"),
        ("t_s,lat,lon,height,state", "no column fix_class .* add a column fix_class"),
        ("lat,lon,height,fix,x", "no column t_s"),
        ("t_s,lat,lon,lat,fix", "column lat appears twice"),
    ],
)
def test_a_missing_column_is_named(tmp_path, header, message):
    with pytest.raises(GpsLogError, match=message):
        read(tmp_path, header + "\n1,49,8,100,4\n")


def test_short_rows_and_rows_without_time_are_counted(tmp_path):
    log = read(tmp_path, "t_s,lat,lon,height,fix\n1,49,8,100,4\nsoon,49,8,100,4\n3,49,8,100,0\n4,49,8")
    assert [fix.line for fix in log.fixes] == [2]
    assert log.notes == [
        "2 damaged or truncated lines skipped, first line 3",
        "1 row without a fix skipped",
    ]


@pytest.mark.slow
@given(st.text(max_size=200))
def test_no_text_breaks_the_reader(tmp_path_factory, text):
    folder = tmp_path_factory.getbasetemp()
    try:
        read(folder, "t_s,lat,lon,height,fix\n1,49,8,100,4\n" + text)
    except GpsLogError:
        pytest.fail("only a header can be at fault")


def test_what_looks_like_a_log():
    assert looks_like_gps_csv(b"# x\nt_s,latitude_deg,longitude_deg\n")
    assert not looks_like_gps_csv(b"t_s,wx_rad_s,wy_rad_s,wz_rad_s\n")
    assert not looks_like_gps_csv(b"latitude\n")


@pytest.mark.parametrize(
    ("cell", "expected"), [("4.0", FixClass.RTK_FIX), ("1e300", FixClass.UNKNOWN), ("inf", FixClass.UNKNOWN)]
)
def test_a_quality_of_any_size(tmp_path, cell, expected):
    text = f"t_s,latitude_deg,longitude_deg,height_m,fix\n0.5,49.2,8.1,100.5,{cell}\n"
    assert read(tmp_path, text).fixes[0].fix_class is expected


@pytest.mark.parametrize("cell", ["nan", "0.0", "0"])
def test_a_quality_that_is_no_fix(tmp_path, cell):
    text = f"t_s,latitude_deg,longitude_deg,height_m,fix\n0.5,49.2,8.1,100.5,{cell}\n"
    assert read(tmp_path, text).fixes == []
