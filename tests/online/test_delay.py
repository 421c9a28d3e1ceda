import io
import json

import numpy as np
import pytest
from fewer_features import fewer_features

from vgps.online.delay import DelayedEstimates
from vgps.online.session import OnlineOptions, pose_recording
from vgps.readers.trajectory import read_trajectory


class Revising:
    """A smoother that adds what it has seen to a pose."""

    def revised(self, estimate):
        return estimate + 100


class Estimate(int):
    """A number as an estimate at a tenth of it."""

    @property
    def t_s(self):
        return 0.1 * self


def test_estimates_come_in_order_once_the_delay_is_over():
    delayed = DelayedEstimates(Revising(), 0.3)
    came = [[one for one, _ in delayed.add(Estimate(k), k)] for k in range(6)]
    assert came == [[], [], [], [100], [101], [102]]
    assert list(delayed.rest()) == [(103, 3), (104, 4), (105, 5)]


def test_without_a_delay_estimates_pass_as_they_are():
    delayed = DelayedEstimates(Revising(), 0.0)
    assert list(delayed.add(Estimate(7), 0.5)) == [(7, 0.5)] and list(delayed.rest()) == []


def poses(recording, lag_s):
    lines = io.StringIO()
    pose_recording(recording, OnlineOptions(config=fewer_features(150), lag_s=lag_s), stream=lines)
    return [entry for entry in map(json.loads, lines.getvalue().splitlines()) if entry["type"] == "pose"]


@pytest.mark.slow
def test_a_second_of_delay_gives_every_frame_and_smaller_sigmas(recording):
    at_once, later = poses(recording, 0.0), poses(recording, 1.0)
    true = read_trajectory(recording / "truth.tum").world_T_camera[:, :3, 3]
    assert [entry["frame"] for entry in later] == [entry["frame"] for entry in at_once]
    both = [
        (a["global"], b["global"], k)
        for k, (a, b) in enumerate(zip(at_once, later, strict=True))
        if a["global"]
    ]

    def away(pose, frame):
        return np.linalg.norm([pose["east_m"], pose["north_m"], pose["up_m"]] - true[frame])

    assert np.mean([away(b, k) for _, b, k in both]) <= np.mean([away(a, k) for a, _, k in both])
    assert np.mean([b["sigma_east_m"] / a["sigma_east_m"] for a, b, _ in both]) < 0.9
