"""The page and the JSON of a comparison."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from trajectories import random_walk

from vgps.compare import ALL_METHODS, Comparison, comparison_to_json, write_comparison
from vgps.compare.page import _COLOURS, ratios
from vgps.evaluation import evaluate
from vgps.solution import Trajectory

B, C = ALL_METHODS[1].name, ALL_METHODS[2].name
OFFSETS_M = {B: 4.0, C: 2.0, "cylinder (16)": 1.0}


@pytest.fixture(scope="module")
def comparison():
    truth = random_walk(1)
    runs = {}
    for name, offset_m in OFFSETS_M.items():
        poses = truth.world_T_camera.copy()
        poses[:, 2, 3] += offset_m
        runs[name] = Trajectory(truth.t_s, poses)
    return Comparison(
        recording=Path("drives/spring"),
        truth=truth,
        evaluations={name: evaluate(run, truth) for name, run in runs.items()},
        paths={name: run.world_T_camera[:, :3, 3] for name, run in runs.items()},
        world_p_fix=np.array([[0.0, 0.0, 0.0], [np.nan] * 3]),
        seconds=dict.fromkeys(OFFSETS_M, 1.5),
    )


def test_ratios_are_those_of_the_mean_antenna_errors(comparison):
    assert ratios(comparison) == {
        B: {"to_B": pytest.approx(1.0), "to_C": pytest.approx(2.0)},
        C: {"to_B": pytest.approx(0.5), "to_C": pytest.approx(1.0)},
        "cylinder (16)": {"to_B": pytest.approx(0.25), "to_C": pytest.approx(0.5)},
    }


@pytest.mark.slow
def test_the_page_stands_alone_and_has_the_errors(comparison, tmp_path):
    page, data = write_comparison(comparison, tmp_path / "deeper")
    html = page.read_text()
    assert html.count("data:image/svg+xml;base64,") == 2 and not re.search(r"(src|href)=\"http", html)
    assert "<td>cylinder (16)</td>" in html and "<td>1.000</td>" in html
    assert json.loads(data.read_text()) == json.loads(json.dumps(comparison_to_json(comparison)))


def test_json_has_errors_seconds_and_ratios_by_method(comparison):
    found = comparison_to_json(comparison)
    assert found["recording"] == "drives/spring" and list(found["methods"]) == list(OFFSETS_M)
    assert found["methods"][C]["camera_position_m"]["mean"] == pytest.approx(2.0)
    assert found["methods"][C]["seconds"] == 1.5 and found["ratios"][C]["to_B"] == pytest.approx(0.5)


def test_every_method_has_a_colour():
    assert len(set(_COLOURS)) == len(ALL_METHODS)
