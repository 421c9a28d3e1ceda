from dataclasses import replace
from pathlib import Path

import pytest
from synthetic_landmarks import random_contents

from vgps.errors import LandmarkDatabaseError, RunFolderError
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.model import DatabaseContents


def test_a_failure_keeps_the_earlier_file_and_leaves_nothing_else(database_path: Path) -> None:
    before = database_path.read_bytes()
    broken = replace(random_contents(1), keyframes=(None,))  # type: ignore[arg-type]
    with pytest.raises(AttributeError):
        write_database(broken, database_path)
    assert database_path.read_bytes() == before
    assert list(database_path.parent.iterdir()) == [database_path]


def test_a_new_file_replaces_one_that_is_open(database_path: Path) -> None:
    with LandmarkDatabase.open(database_path) as database:
        write_database(random_contents(7, landmarks=20), database_path)
        assert len(database.positions()) == database.landmark_count == 300
    with LandmarkDatabase.open(database_path) as database:
        assert database.landmark_count == 20


def test_equal_contents_give_equal_bytes(database_path: Path) -> None:
    again = database_path.with_name("again.vgps")
    write_database(random_contents(landmarks=300), again)
    assert again.read_bytes() == database_path.read_bytes()


def test_contents_without_landmarks_are_refused(tmp_path: Path) -> None:
    contents = random_contents()
    views = replace(contents.views, **{name: values[:0] for name, values in vars(contents.views).items()})
    with pytest.raises(LandmarkDatabaseError, match="has no landmarks to write"):
        write_database(DatabaseContents(contents.world_origin, views, (), ()), tmp_path / "x")
    assert not list(tmp_path.iterdir())


def test_a_folder_is_no_output(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="is a folder"):
        write_database(random_contents(), tmp_path)
    assert not list(tmp_path.iterdir())
