import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vgps.crs import egm96, named_geoid
from vgps.errors import CoordinateSystemError

# NGA's file OUTPUT.DAT of EGM96: latitude, longitude, height of the geoid
PUBLISHED = [
    (38.6281550, 269.7791550, -31.628),
    (-14.6212170, 305.0211140, -2.969),
    (46.8743190, 102.4487290, -43.575),
    (-23.6174460, 133.8747120, 15.871),
    (38.6254730, 359.9995000, 50.066),
    (-0.4667440, 0.0023000, 17.329),
]


def write_gtx(path, grid, south=40.0, west=0.0, step=1.0):
    head = struct.pack(">4d2i", south, west, step, step, *grid.shape)
    path.write_bytes(head + grid.astype(">f4").tobytes())


def write_pgm(path, metres):
    """Write a whole Earth, rows from the south, as GeographicLib does."""
    raw = np.round((metres[::-1] + 108.0) / 0.003).astype(">u2")
    head = f"P5\n# Geoid file\n# Offset -108\n# Scale 0.003\n{raw.shape[1]}  {raw.shape[0]}\n65535\n"
    path.write_bytes(head.encode() + raw.tobytes())


def test_egm96_at_the_published_points():
    latitude, longitude, height = np.array(PUBLISHED).T
    np.testing.assert_allclose(egm96().height_m(latitude, longitude), height, atol=0.006)
    # one by one, west of Greenwich and without the whole grid around them
    alone = [egm96().height_m(a, (b + 180) % 360 - 180) for a, b, _ in PUBLISHED]
    np.testing.assert_allclose(alone, height, atol=0.006)


@settings(max_examples=25)
@given(st.floats(-90, 90), st.floats(-720, 720))
def test_egm96_is_defined_and_smooth_everywhere(latitude, longitude):
    height = egm96().height_m([latitude, latitude], [longitude, longitude + 1e-7])
    assert np.all(np.abs(height) < 110) and abs(height[1] - height[0]) < 1e-4


def test_a_position_that_is_unknown_has_no_height():
    assert np.isnan(egm96().height_m([np.nan], [8.0])).all()


@pytest.mark.parametrize("folder", ["plain", "with blanks, commas"])
def test_a_file_in_proj_s_format(tmp_path, folder):
    (tmp_path / folder).mkdir()
    file = tmp_path / folder / "local.gtx"
    rows, columns = np.meshgrid(np.arange(5.0), np.arange(4.0), indexing="ij")
    write_gtx(file, 40 + rows + 0.1 * columns)
    geoid = named_geoid(str(file))
    assert geoid.name == "local"
    np.testing.assert_allclose(geoid.height_m([41.5, 43.0], [2.0, 1.5]), [41.7, 43.15], atol=1e-5)
    with pytest.raises(CoordinateSystemError, match=r"the geoid local has no height at 30\.0000°, 2\.0000°"):
        geoid.height_m([41.5, 30.0], [2.0, 2.0])


def test_a_file_in_geographiclib_s_format(tmp_path):
    latitude, longitude = np.meshgrid(np.arange(-90.0, 91.0), np.arange(360.0), indexing="ij")
    metres = 30 * np.sin(np.radians(latitude)) + 10 * np.cos(np.radians(longitude))
    write_pgm(tmp_path / "smooth.pgm", metres)
    found = named_geoid(str(tmp_path / "smooth.pgm")).height_m([48.3, -20.7], [11.6, -0.4])
    true = 30 * np.sin(np.radians([48.3, -20.7])) + 10 * np.cos(np.radians([11.6, -0.4]))
    np.testing.assert_allclose(found, true, atol=0.005)


def test_a_number_is_a_geoid_of_one_height():
    assert named_geoid("47.9").height_m([1.0, 2.0], [3.0, 4.0]).tolist() == [47.9, 47.9]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("egm2008", r"no grid of the geoid egm2008; expected egm96, a grid file .* us_nga_egm08_25\.tif in"),
        ("nosuch.gtx", r"no grid of the geoid nosuch\.gtx"),
        ("inf", "a geoid height of inf; expected a finite number"),
    ],
)
def test_a_missing_grid_is_said_in_a_line(text, message):
    with pytest.raises(CoordinateSystemError, match=message):
        named_geoid(text)


@pytest.mark.parametrize("name", ["rubbish.gtx", "rubbish.tif", "rubbish.pgm"])
def test_what_is_no_grid_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"P5\n3 3\n65535\nhello")
    with pytest.raises(CoordinateSystemError, match=f"{name}: not a (grid of heights|geoid grid)"):
        named_geoid(str(tmp_path / name))
