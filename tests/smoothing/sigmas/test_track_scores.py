"""What tracks contribute to the reduced gradient is the same from the disk, however often it is taken."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_bundle import drive

from vgps.model import FloatArray
from vgps.smoothing.sigmas.track_scores import track_scores
from vgps.solver.equations import chunks
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.equations.schur_complement import reduce_to_poses
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.problem import BundleProblem


def reduced_gradient(problem: BundleProblem) -> FloatArray:
    structure = analyse_sparsity(problem)
    return reduce_to_poses(linearise(problem, all_pose_values(problem), structure), structure, 0.0)[1]


def test_all_tracks_together_contribute_the_reduced_gradient_of_the_observations(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(chunks, "CHUNK_OBSERVATIONS", 50)
    problem, _ = drive(frames=12, landmarks=150)
    fixed = np.arange(12) < 2
    problem = replace(problem, fixed=fixed, pose_graph=type(problem.pose_graph)())
    structure = analyse_sparsity(problem)
    assert len(structure.chunks) > 3
    linear, gradient = linearise(problem, all_pose_values(problem), structure), reduced_gradient(problem)
    signs = np.ones((150, 2), np.int8)
    signs[:, 1] = np.where(np.arange(150) % 2, 1, -1)
    totals: list[FloatArray] = []
    for on_disk in (False, True):
        scores = track_scores(linear, structure, on_disk)
        for _ in range(1 + on_disk):
            totals.append(np.zeros((60, 2)))
            for part in scores:
                part.add_to(totals[-1], signs)
    np.testing.assert_allclose(totals[0][:, 0], gradient, atol=1e-8 * np.abs(gradient).max())
    even, odd = (
        reduced_gradient(problem.select_observations(np.flatnonzero(problem.landmark % 2 == k)))
        for k in (0, 1)
    )
    np.testing.assert_allclose(totals[0][:, 1], odd - even, atol=1e-8 * np.abs(gradient).max())
    np.testing.assert_array_equal(totals[1], totals[0])
    np.testing.assert_array_equal(totals[2], totals[0])
