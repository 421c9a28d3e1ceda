import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from exports import exported

from vgps.errors import RunFolderError


def test_geojson_has_the_path_and_every_fix(solution, tmp_path):
    found = json.loads(exported(solution, tmp_path, "geojson", "run.geojson").read_text())
    line, *points = found["features"]
    longitude, latitude, height = line["geometry"]["coordinates"][0]
    assert (longitude, latitude) == pytest.approx((8.4165, 49.011), abs=1e-3)
    assert height == pytest.approx(163, abs=20)
    assert len(line["geometry"]["coordinates"]) == len(solution.t_s)
    assert [point["properties"]["verdict"] for point in points] == ["used"]  # the other has no place


def test_kml_parses_and_has_the_path_and_every_fix(solution, tmp_path):
    root = ET.parse(exported(solution, tmp_path, "kml", "run.kml")).getroot()
    space = {"k": "http://www.opengis.net/kml/2.2"}
    assert len(root.findall(".//k:LineString", space)) == 1 and len(root.findall(".//k:Point", space)) == 1
    coordinates = root.find(".//k:LineString/k:coordinates", space).text.split()
    assert len(coordinates) == len(solution.t_s)


@pytest.mark.parametrize("to", ["geojson", "kml"])
def test_without_georeference_there_is_no_map(solution, tmp_path, to):
    with pytest.raises(RunFolderError, match="not georeferenced"):
        exported(replace(solution, georeferenced=False), tmp_path, to, "x")
