"""Errors of poses that a changed recording gets."""

import numpy as np
import pytest

import vgps
from scripts.common.both_ways import Case, pose_errors


@pytest.fixture
def case(recording):
    return Case("none", vgps.open_recording(recording), np.array([0, 2, 4]), np.tile(np.eye(4), (3, 1, 1)))


def test_frames_that_count_and_have_a_pose_are_compared(case):
    poses = np.tile(np.eye(4), (5, 1, 1))
    poses[:, 0, 3] = [1.0, 50.0, np.nan, 50.0, 3.0]
    poses[4, :2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    found = pose_errors(case, poses)
    assert found == pytest.approx(
        {"mean_m": 2.0, "max_m": 3.0, "rotation_deg": 45.0, "rotation_max_deg": 90.0}
    )


def test_without_a_pose_there_is_no_error(case):
    assert np.isnan(list(pose_errors(case, np.full((5, 4, 4), np.nan)).values())).all()
