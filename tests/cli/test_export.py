"""``vgps export`` as a user runs it."""

import pytest


@pytest.mark.parametrize("to", ["tum", "ply", "kitti", "nerfstudio", "geojson", "kml", "gpx"])
def test_export(smoothed, tmp_path, vgps_verb, to):
    code, _, _ = vgps_verb("export", smoothed, "--to", to, "--out", tmp_path / f"x.{to}")
    assert code == 0 and (tmp_path / f"x.{to}").stat().st_size > 1000


def test_brackets_and_colons_in_a_path_are_printed_verbatim(smoothed, tmp_path, vgps_verb):
    out = tmp_path / "[bold]a[/bold] :car:" / "x[/red].tum"
    code, printed, _ = vgps_verb("export", smoothed, "--to", "tum", "--out", out)
    assert code == 0 and printed == f"wrote {out}\n"
