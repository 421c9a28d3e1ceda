"""Evaluations as tables and JSON."""

import io
import json

import numpy as np
from rich.console import Console
from rich.table import Table
from trajectories import random_walk, trajectory

from vgps.evaluation import comparison_table, evaluation_table, to_json, trajectory_errors
from vgps.solution import Trajectory

NO_LEVER = np.zeros(3)


def rendered(renderable: Table) -> str:
    console = Console(file=io.StringIO(), width=160)
    console.print(renderable)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_json_has_units_in_its_keys_and_no_nan() -> None:
    found = to_json(trajectory_errors(random_walk(6), random_walk(7), NO_LEVER))
    assert set(found["camera_position_m"]) == {"mean", "median", "rmse", "std", "max"}
    assert found["every_frame_posed"] is True
    assert found["nees"] is None
    assert "camera_error_m" not in found
    assert json.loads(json.dumps(found, allow_nan=False)) == found


def test_table_shows_every_error_and_how_frames_were_matched() -> None:
    times = np.arange(5) / 10
    offset, truth = trajectory(times, [3, 4, -12]), trajectory(times, [0, 0, 0])
    text = rendered(evaluation_table(trajectory_errors(offset, truth, NO_LEVER)))
    (row,) = [line for line in text.splitlines() if "camera position [m]" in line]
    assert row.count("13.000") == 4  # mean, median, rmse, max
    assert "5 of 5 frames of the truth matched, every frame has a pose" in text
    assert "SE(3)" not in text


def test_comparison_has_a_row_per_run() -> None:
    truth = random_walk(8)
    shift = np.array([[0, 0, 0, 0.5]] * 3 + [[0, 0, 0, 0]])
    moved = Trajectory(truth.t_s[:-1], truth.world_T_camera[:-1] + shift)
    runs = {"truth": truth, "moved [b]": moved}
    errors = [(name, trajectory_errors(run, truth, NO_LEVER)) for name, run in runs.items()]
    text = rendered(comparison_table(errors))
    (row,) = [line for line in text.splitlines() if "moved [b]" in line]
    assert "39/40" in row
    assert f"{np.sqrt(3) / 2:.3f}" in row
