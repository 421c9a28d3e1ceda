import sqlite3
from pathlib import Path

import numpy as np
import pytest
from synthetic_landmarks import random_contents
from whole_database import all_views

from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.database_file import DatabaseFile
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.template_cache import TemplateCache


@pytest.mark.slow
def test_a_cache_smaller_than_the_database_gives_the_same_templates(tmp_path: Path) -> None:
    contents = random_contents(2, landmarks=4500)  # of at most 300 bytes each: 1.3 MB
    write_database(contents, tmp_path / "landmarks.vgps")
    views = all_views(tmp_path / "landmarks.vgps", cache_mb=1)
    np.testing.assert_array_equal(views.templates, contents.views.templates)


def test_templates_are_read_once_and_replaced_when_the_cache_is_full(tmp_path: Path, monkeypatch) -> None:
    write_database(random_contents(2, landmarks=4500), tmp_path / "landmarks.vgps")
    file = DatabaseFile(tmp_path / "landmarks.vgps")
    cache, queries = TemplateCache(file, 1), []
    rows = file.rows
    monkeypatch.setattr(file, "rows", lambda query, values=(): queries.append(query) or rows(query, values))
    first = np.arange(10)
    before = cache.take(first, np.zeros(10, int))
    assert len(queries) == 1
    np.testing.assert_array_equal(cache.take(first, np.zeros(10, int)), before)
    assert len(queries) == 1
    cache.take(np.arange(10, 4500), np.zeros(4490, int))
    queries.clear()
    np.testing.assert_array_equal(cache.take(first, np.zeros(10, int)), before)
    assert len(queries) == 1


@pytest.mark.parametrize("damage", ["DELETE FROM template WHERE id = 3", "UPDATE template SET check_sum = 0"])
def test_damaged_templates_are_reported(database_path: Path, damage: str) -> None:
    file = sqlite3.connect(database_path)
    file.execute(damage)
    file.commit()
    file.close()
    cache = TemplateCache(DatabaseFile(database_path), 256)
    with pytest.raises(LandmarkDatabaseError, match=r"is damaged \(templates of landmarks 2 to 5\)"):
        cache.take(np.arange(2, 6), np.zeros(4, int))
