"""The map, read back from a saved recording."""

import pytest
from reading_back import Logged


def test_the_map_begins_at_the_origin_and_goes_north(logged: Logged) -> None:
    (path,) = logged.rows("/map/path", "GeoLineStrings:line_strings")[0]
    assert path[0] == pytest.approx([49.0, 8.0], abs=1e-9)
    assert path[-1][0] == pytest.approx(49.0 + 5 / 111_220, abs=1e-7)  # metres in a degree at 49 N
