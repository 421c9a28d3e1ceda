"""``vgps export`` as a user runs it."""

import pytest

pytestmark = pytest.mark.slow


def test_coordinates_frames_and_columns_are_those_asked_for(smoothed, tmp_path, vgps_verb):
    out = tmp_path / "x.csv"
    asked = ("--crs", "EPSG:32653", "--geoid", "30", "--every-s", 2, "--columns", "x,height")
    code, printed, _ = vgps_verb("export", smoothed, "--to", "csv", "--out", out, *asked)
    described = "WGS 84 / UTM zone 53N (EPSG:32653), height above a geoid 30 m above the ellipsoid"
    assert code == 0 and f"wrote {out}: {described}" in printed
    header, *rows = out.read_text().splitlines()
    assert header.startswith("easting_m,height_") and len(rows) == 3


def test_brackets_and_colons_in_a_path_are_printed_verbatim(smoothed, tmp_path, vgps_verb):
    out = tmp_path / "[bold]a[/bold] :car:" / "x[/red].tum"
    code, printed, _ = vgps_verb("export", smoothed, "--to", "tum", "--out", out)
    assert code == 0 and printed == f"wrote {out}\n"
