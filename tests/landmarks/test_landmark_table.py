from pathlib import Path

import numpy as np
import pytest
from synthetic_landmarks import random_contents

from tests.support.synthetic_landmarks import plane_normals
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.landmark_table import LandmarkTable


@pytest.mark.slow
def test_derived_columns_follow_from_the_views(tmp_path: Path) -> None:
    views = random_contents(2, landmarks=150).views
    write_database(random_contents(2, landmarks=150), tmp_path / "landmarks.vgps")
    file = DatabaseFile(tmp_path / "landmarks.vgps")
    table = LandmarkTable(file)
    rows = table.rows([cell for (cell,) in file.rows("SELECT id FROM cell_box")])
    assert sorted(table.landmark[rows].tolist()) == np.unique(views.landmark).tolist()
    for row in rows:
        mine = views.landmark == table.landmark[row]
        assert table.count[row] == mine.sum()
        to_camera = views.world_p_camera[mine] - views.world_p_landmark[mine]
        distance = np.linalg.norm(to_camera, axis=1, keepdims=True)
        direction = to_camera / distance
        octave = np.log2(distance[:, 0] / np.sqrt(260.0 * 255.0))
        geometry = table.view_geometry[row].T
        np.testing.assert_allclose(geometry[: mine.sum(), :3], direction, atol=1e-6)
        np.testing.assert_allclose(geometry[: mine.sum(), 3:6], plane_normals(views)[mine], atol=1e-6)
        np.testing.assert_allclose(geometry[: mine.sum(), 6], octave, atol=1e-5)
        assert np.isnan(geometry[mine.sum() :]).all()
        mean = direction.sum(axis=0) / np.linalg.norm(direction.sum(axis=0))
        np.testing.assert_allclose(table.mean_direction[row], mean, atol=1e-6)
        spread = np.arccos(np.clip(direction @ mean, -1, 1)).max()
        np.testing.assert_allclose(table.spread_rad[row], spread, atol=1e-3)
        np.testing.assert_allclose(table.octaves[row], [octave.min(), octave.max()], atol=1e-5)


def test_a_cell_is_read_once(tmp_path: Path) -> None:
    write_database(random_contents(2, landmarks=150), tmp_path / "landmarks.vgps")
    file = DatabaseFile(tmp_path / "landmarks.vgps")
    table = LandmarkTable(file)
    first = table.rows([1])
    table.numbers[first[0]] = 0  # would be overwritten by a second reading
    np.testing.assert_array_equal(table.rows([1]), first)
    assert not table.numbers[first[0]].any()
