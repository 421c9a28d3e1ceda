"""Whitened residuals of second halves: independent errors give 0.71, drifting tracks more."""

import numpy as np
import pytest
from solutions import make_landmarks, make_poses, make_solution

from scripts.experiments.observation_sigmas import linearise, whitened
from vgps.geometry import project
from vgps.solution import Observations

FRAMES, LANDMARKS, SIGMA_PX = 40, 300, 0.5
NORTH = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def run_with(drift_px: float):
    """Return a path to the right past landmarks; pixels have noise, and drift along their tracks."""
    rng = np.random.default_rng(0)
    poses = make_poses(np.outer(0.2 * np.arange(FRAMES), [1.0, 0.0, 0.0]), NORTH)
    points = rng.uniform([-2.0, 8.0, -2.0], [10.0, 12.0, 2.0], (LANDMARKS, 3))
    run = make_solution(0.1 * np.arange(FRAMES), poses, landmarks=make_landmarks(points))
    frame, landmark = np.repeat(np.arange(FRAMES), LANDMARKS), np.tile(np.arange(LANDMARKS), FRAMES)
    uv = np.concatenate([project(run.camera.K, pose, points)[0] for pose in poses])
    uv += SIGMA_PX * rng.normal(size=uv.shape)
    uv += drift_px * (frame[:, None] / FRAMES) ** 2 * rng.normal(size=(LANDMARKS, 2))[landmark]
    return make_solution(
        run.t_s, poses, landmarks=run.landmarks, observations=Observations(frame, landmark, uv)
    )


def test_independent_errors_are_predicted_by_the_first_half():
    # sigma is that of the error's length, from 40 residuals less three coordinates; E[1 / chi2_37] = 1 / 35
    assert np.sqrt(whitened(run_with(0.0), 0.1).mean() / 2) == pytest.approx(np.sqrt(40 / 35 / 2), abs=0.02)


def test_tracks_that_drift_are_told():
    assert np.sqrt(whitened(run_with(5.0), 0.1).mean() / 2) > 2.0


def test_jacobians():
    run, step = run_with(0.0), 1e-6
    poses, uv = run.world_T_camera[:5], np.zeros((5, 2))
    points = run.landmarks.world_p_landmark[:5]
    _, jacobian = linearise(run.camera.K, poses, points, uv)
    for axis in range(3):
        moved = points + step * np.eye(3)[axis]
        change = linearise(run.camera.K, poses, moved, uv)[0] - linearise(run.camera.K, poses, points, uv)[0]
        np.testing.assert_allclose(change / step, jacobian[:, :, axis], rtol=1e-4, atol=1e-3)
