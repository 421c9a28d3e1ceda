"""The runs that the viewer's tests show."""

from dataclasses import replace

import pytest
from solutions import short_drive

from vgps.solution import Solution


@pytest.fixture
def solution() -> Solution:
    return short_drive()


@pytest.fixture
def late(solution: Solution) -> Solution:
    """The same run with time stamps that are 0.25 s late, and the time offset that says so."""
    assert solution.gps is not None
    gps = replace(solution.gps, t_s=solution.gps.t_s + 0.25)
    return replace(solution, gps=gps, sensors=replace(solution.sensors, time_offset_s=0.25))
