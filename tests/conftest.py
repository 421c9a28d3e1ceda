"""Fixtures for every test."""

import os
from pathlib import Path

import pytest
from recordings import small_recording


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real recordings; the test is skipped where it is absent."""
    default = Path(__file__).resolve().parents[1] / "../shared/data"
    folder = Path(os.environ.get("VGPS_DATA", default)).resolve()
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}; name their folder in VGPS_DATA")
    return folder


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small simulated recording with truth; copy it before you change it."""
    return small_recording(tmp_path_factory.mktemp("recording") / "walk")
