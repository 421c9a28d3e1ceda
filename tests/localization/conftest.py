"""Fixtures shared by the tests of localization."""

import pytest
from textured_wall import WallDatabase


@pytest.fixture(scope="session")
def database() -> WallDatabase:
    """A database of the textured wall, in memory."""
    return WallDatabase()
