"""Fixtures for every test."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings; the test is skipped where it is absent."""
    default = Path(__file__).resolve().parents[1] / "../shared/data"
    folder = Path(os.environ.get("VGPS_DATA", default)).resolve()
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}; name their folder in VGPS_DATA")
    return folder
