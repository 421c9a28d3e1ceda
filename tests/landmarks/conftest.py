"""Fixtures shared by the tests of the landmark database."""

from pathlib import Path

import pytest
from synthetic_landmarks import random_contents
from synthetic_run import WallRun, make_wall_run

from vgps.landmarks.database_writer import write_database


@pytest.fixture(scope="session")
def wall(tmp_path_factory: pytest.TempPathFactory) -> WallRun:
    """A run along a textured wall; do not change its folders."""
    return make_wall_run(tmp_path_factory.mktemp("wall"))


@pytest.fixture
def database_path(tmp_path: Path) -> Path:
    """A database of 300 random landmarks, alone in its folder."""
    out = tmp_path / "landmarks.vgps"
    write_database(random_contents(landmarks=300), out)
    return out
