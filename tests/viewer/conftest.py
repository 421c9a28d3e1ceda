"""The run that the viewer's tests show, and its saved recording."""

from dataclasses import replace

import pytest
from reading_back import Logged
from solutions import short_drive

from vgps.solution import Solution
from vgps.viewer import inspect_run


@pytest.fixture(scope="session")
def solution() -> Solution:
    return short_drive()


@pytest.fixture(scope="session")
def late(solution: Solution) -> Solution:
    """The same run with time stamps that are 0.25 s late, and the time offset that says so."""
    assert solution.gps is not None
    gps = replace(solution.gps, t_s=solution.gps.t_s + 0.25)
    return replace(solution, gps=gps, sensors=replace(solution.sensors, time_offset_s=0.25))


@pytest.fixture(scope="session")
def logged(solution: Solution, tmp_path_factory: pytest.TempPathFactory) -> Logged:
    """What the saved recording of the run holds."""
    file = tmp_path_factory.mktemp("viewer") / "run.rrd"
    assert inspect_run(solution, save=file) == ()
    return Logged(file)
