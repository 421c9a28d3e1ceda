"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest
from hypothesis import settings
from recordings import small_recording

settings.register_profile("vgps", deadline=None)  # a loaded machine is no failure
settings.load_profile("vgps")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real recordings, or skip the test."""
    default = Path(__file__).resolve().parents[1] / "../shared/data"
    folder = Path(os.environ.get("VGPS_DATA", default)).resolve()
    if not folder.is_dir():
        pytest.skip(f"{folder}: no real recordings; set VGPS_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a small simulated recording with its truth; copy it before changing it."""
    return small_recording(tmp_path_factory.mktemp("recording") / "walk")
