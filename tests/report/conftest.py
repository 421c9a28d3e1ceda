"""The run that the report's tests describe."""

import pytest
from solutions import minute_drive

from vgps.solution import Solution


@pytest.fixture(scope="session")
def solution() -> Solution:
    return minute_drive()
