import numpy as np
import pytest
from pyproj import CRS

from vgps.crs import CoordinateSystem, coordinate_system
from vgps.errors import CoordinateSystemError

PLACE = (49.0, 8.4)


@pytest.mark.parametrize(
    ("crs", "geoid", "column"),
    [
        (None, None, "height_ellipsoidal_m"),
        ("EPSG:25832", "egm96", "height_egm96_m"),
        ("EPSG:25832", "48.5", "height_a_geoid_48.5_m_above_the_ellipsoid_m"),
    ],
)
def test_the_column_of_heights_names_their_datum(crs, geoid, column):
    assert coordinate_system(PLACE, crs, geoid).height_column == column


def test_definitions_have_the_heights_for_libraries_and_not_for_older_formats():
    system = coordinate_system(PLACE, "EPSG:25832", "egm96")
    assert [part.to_epsg() for part in system.definition.sub_crs_list] == [25832, 5773]
    assert system.horizontal_wkt1.startswith('PROJCS["ETRS89 / UTM zone 32N"')
    flat = coordinate_system(PLACE, "EPSG:25832")
    assert len(flat.definition.axis_info) == 3 and flat.horizontal_wkt1 == system.horizontal_wkt1


def test_a_place_without_an_image_is_refused():
    system = coordinate_system(PLACE, "EPSG:32632")
    with pytest.raises(CoordinateSystemError, match="a position cannot be converted to WGS 84 / UTM"):
        system.from_geodetic(np.array([[0.0, 99.0, 0.0]]))


def test_without_a_transformer_coordinates_pass_through():
    axes = ("longitude_deg", "latitude_deg", "h")
    plain = CoordinateSystem(name="n", height_datum="h", axes=axes, definition=CRS(4979))
    assert plain.to_geodetic(np.array([[8.0, 49.0, 5.0]])).tolist() == [[49.0, 8.0, 5.0]]
