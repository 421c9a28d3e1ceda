"""Figures that scripts compute from their rows, by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from scripts.common.markdown import growth_table
from scripts.experiments.matsuda.rates import as_markdown as rates_table
from scripts.experiments.matsuda.tracking_errors import errors_of
from scripts.experiments.nees import figures
from scripts.experiments.settings import Case, Errors, ratio_to_defaults


def test_a_setting_is_compared_by_the_geometric_mean():
    found = {
        Case("log", 0): {"defaults": Errors(1.0, 3.0), "gps.n=4": Errors(2.0, 3.0)},
        Case("log", 1): {"defaults": Errors(1.0, 3.0), "gps.n=4": Errors(0.5, 3.0)},
    }
    assert ratio_to_defaults(found, "gps.n=4") == "1.00 (x/ 4.00)"  # standard error of the logs: log 2
    assert ratio_to_defaults({Case("log", 0): found[Case("log", 0)]}, "gps.n=4") == "2.00"


def test_nees_is_per_axis():
    ratio = np.array([[1.0, 1.0, 1.0], [3.0, 0.0, 0.0]])
    found = figures(ratio)
    assert found["nees_mean"] == pytest.approx(2.0)  # of 1 and 3
    assert (found["inside_east_percent"], found["inside_north_percent"]) == (50.0, 100.0)
    assert found["inside_percent"] == pytest.approx(100 * 5 / 6)


def test_tracking_errors_count_tracked_frames_alone():
    def frame(tracked, east_m, angle_deg):
        pose, (c, s) = np.eye(4), (np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg)))
        pose[:2, :2], pose[0, 3] = [[c, -s], [s, c]], east_m
        return SimpleNamespace(tracked=tracked, world_T_camera=pose)

    frames = [frame(True, 1.0, 10.0), frame(True, 0.1, 1.0), frame(False, 9.0, 90.0), frame(True, 0.3, 2.0)]
    found = errors_of(frames, np.tile(np.eye(4), (4, 1, 1))).figures(slice(1, None, 2))
    assert found["position_mean_m"] == pytest.approx(0.2) and found["position_max_m"] == pytest.approx(0.3)
    assert found["rotation_max_deg"] == pytest.approx(2.0)
    assert (found["held"], found["frames"], found["first_loss"]) == (3, 4, 2)


def test_a_variant_is_lost_at_the_lowest_rate_at_which_it_holds_too_few():
    text = rates_table([0.0, 100.0, 200.0], {"paper": [1.0, 0.8, 0.95], "ours": [1.0, 1.0, 0.9]})
    assert "| paper | 100 % | 80 % | 95 % | 100 deg/s |" in text
    assert "| ours | 100 % | 100 % | 90 % | never |" in text


def test_growth_is_by_factors_from_length_to_length():
    text = growth_table([{"frames": 100.0, "wall [s]": 2.0}, {"frames": 400.0, "wall [s]": 9.0}])
    assert "| frames | 100 | 400 | x 4.00 |" in text and "| wall [s] | 2 | 9 | x 4.50 |" in text
