"""Runs whose video went astray are followed by one that believes all fixes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from distinct_solution import distinct_values

import vgps
from vgps.config import Config
from vgps.errors import GeometryError
from vgps.pipeline import offline
from vgps.runtime.progress import NoProgress


def followed_by(again, recording, left, monkeypatch):
    """What follows a solution whose video left so many fixes behind, and whether it judges fixes."""
    judging = []

    def smoothed(run, _):
        judging.append(run.config.outliers.enabled)
        if again is None:
            raise GeometryError("no path")
        return again, run

    monkeypatch.setattr(offline, "_smoothed", smoothed)
    monkeypatch.setattr(offline, "left_by_the_video", lambda *_: np.arange(left))
    run = offline._Run(vgps.open_recording(recording), Config())
    return offline._with_believed_fixes(distinct_values(), run, NoProgress()), judging


def test_what_the_video_left_behind_is_believed_in_another_run(recording: Path, monkeypatch):
    found, judging = followed_by(replace(distinct_values(), seconds={}), recording, 1, monkeypatch)
    assert judging == [False] and found.seconds == {}
    assert found.warnings[0].startswith("the video went astray") and len(found.warnings) == 2


@pytest.mark.parametrize(("left", "runs"), [(0, 0), (1, 1)])
def test_without_such_fixes_or_another_path_the_run_stays(recording: Path, monkeypatch, left, runs):
    found, judging = followed_by(None, recording, left, monkeypatch)
    assert found.warnings == distinct_values().warnings and len(judging) == runs
