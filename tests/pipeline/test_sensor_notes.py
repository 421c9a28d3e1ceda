"""What is said of a time offset that stage D decided on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vgps.gps.sensors import Sensors, TimeOffset
from vgps.pipeline.sensor_notes import clock_notes

HELD = Sensors.fixed(np.zeros(3))
CERTAIN = HELD.with_time_offset(TimeOffset(0.2, 0.02))
TOLD = replace(CERTAIN, poses_tell=True)
LIKELY = HELD.with_time_offset(TimeOffset(0.2, 0.05), 0.8)


def notes(before, after):
    batch = SimpleNamespace(sensors=after, time_offset_sigma_s=np.array([0.02]))
    return clock_notes(SimpleNamespace(sensors=before), batch)


@pytest.mark.parametrize("before", [HELD, LIKELY])
def test_a_time_offset_that_the_poses_told_is_named(before):
    (text,) = notes(before, TOLD)
    assert "0.200 s (standard deviation 0.020 s) older" in text and "all poses" in text


def test_one_that_stage_d_could_not_try_is_named_with_its_probability():
    (text,) = notes(LIKELY, LIKELY)
    assert "with a probability of 80%" in text


@pytest.mark.parametrize(("before", "after"), [(HELD, HELD), (LIKELY, HELD), (CERTAIN, TOLD)])
def test_nothing_is_said_twice_or_of_a_clock_that_is_right(before, after):
    assert notes(before, after) == ()
