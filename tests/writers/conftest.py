"""The run that every writer's test writes."""

import pytest
from solutions import distinct_values

from vgps.solution import Solution


@pytest.fixture
def solution() -> Solution:
    return distinct_values()
