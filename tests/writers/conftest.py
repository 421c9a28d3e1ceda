"""The runs that writers' tests write."""

from pathlib import Path

import pytest
from solutions import distinct_values, make_solution

from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Solution


@pytest.fixture
def solution() -> Solution:
    return distinct_values()


@pytest.fixture(scope="session")
def true_run(recording: Path) -> Solution:
    """The small simulated recording with its true poses, as a run that found them exactly."""
    truth, opened = read_trajectory(recording / "truth.tum"), open_recording(recording)
    return make_solution(
        truth.t_s,
        truth.world_T_camera,
        recording=recording,
        camera=opened.camera,
        world_origin=opened.rig.world_origin,
        video_start_utc=opened.rig.video_start_utc,
    )
