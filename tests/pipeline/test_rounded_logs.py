"""Logs whose positions have few digits, on a real drive."""

from dataclasses import replace

import numpy as np
import pytest
from fewer_features import fewer_features

import vgps
from vgps.evaluation import evaluate
from vgps.readers.gps_formats.last_digits import LastDigits
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Verdict

pytestmark = pytest.mark.slow


def test_accurate_fixes_of_five_decimals_are_believed_to_their_last_digits(data_dir):
    """As accurate as they say, most contradict each other: 13 of 16 were refused, and poses 0.54 m off."""
    recording = vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea")
    log = recording.gps
    place = log.latitude_deg.round(5), log.longitude_deg.round(5), log.height_m.round(1)
    rounding_m = np.tile(LastDigits().add(*place).rounding_m, (len(log), 1))
    names = "latitude_deg", "longitude_deg", "height_m"
    log = replace(log, **dict(zip(names, place, strict=True)), rounding_m=rounding_m)
    solution = vgps.smooth(replace(recording, gps=log), fewer_features(150))
    truth = read_trajectory(data_dir / "kitti07/truth.tum")
    assert set(solution.fixes.verdict) == {Verdict.USED}
    assert evaluate(solution, truth).camera_position_m.mean < 0.25
