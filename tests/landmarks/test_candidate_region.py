from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_landmarks import CAMERA, random_contents, random_poses

from vgps.config import SelectionConfig
from vgps.landmarks.candidate_region import Optics, find_candidates
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.landmark_table import LandmarkTable
from vgps.landmarks.view_selection import best_views, visible_landmarks

CONFIG = SelectionConfig(region_m=3.0)
CENTRE = np.array([1.0, -2.0, 0.5])


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> DatabaseFile:
    path: Path = tmp_path_factory.mktemp("region") / "landmarks.vgps"
    write_database(random_contents(3, landmarks=1500), path)
    return DatabaseFile(path)


def whole_table(file: DatabaseFile) -> LandmarkTable:
    table = LandmarkTable(file)
    table.rows([cell for (cell,) in file.rows("SELECT id FROM cell_box")])
    return table


def test_no_landmark_that_a_camera_in_the_region_could_use_is_missing(file: DatabaseFile) -> None:
    optics = Optics.of(CAMERA, 60.0)
    region = find_candidates(CENTRE, optics, file, LandmarkTable(file), CONFIG)
    table, usable = whole_table(file), set()
    points = np.column_stack([table.numbers[:, :3], np.ones(len(table.numbers))]).T.astype(np.float32)
    for pose in random_poses(np.random.default_rng(5), 200, 1.7):  # 1.7 m on each axis are within 3 m
        pose[:3, 3] += CENTRE
        visible = visible_landmarks(pose, CAMERA, points, 60.0)
        to_camera = (pose[:3, 3:] - points[:3, visible.row]).astype(np.float32)
        best = best_views(to_camera, visible.pixel_m, table.view_geometry[visible.row], CONFIG)
        usable |= set(visible.row[best.view >= 0].tolist())
    assert 100 < len(usable) <= len(region.rows) < len(table.landmark)
    assert usable <= set(region.rows.tolist())


def test_points_are_relative_to_the_centre(file: DatabaseFile) -> None:
    table = LandmarkTable(file)
    region = find_candidates(CENTRE, Optics.of(CAMERA, None), file, table, CONFIG)
    np.testing.assert_allclose(region.points[:3].T, table.numbers[region.rows, :3] - CENTRE, rtol=1e-6)
    assert (region.points[3] == 1).all()


def test_it_serves_cameras_near_its_centre_with_the_same_optics(file: DatabaseFile) -> None:
    optics = Optics.of(CAMERA, 60.0)
    region = find_candidates(CENTRE, optics, file, LandmarkTable(file), CONFIG)
    assert region.serves(CENTRE + np.array([0, 0, 2.9]), optics)
    assert not region.serves(CENTRE + np.array([0, 0, 3.1]), optics)
    assert not region.serves(CENTRE, Optics.of(CAMERA, 50.0))
    assert not region.serves(CENTRE, Optics.of(replace(CAMERA, fx=520.0), 60.0))
