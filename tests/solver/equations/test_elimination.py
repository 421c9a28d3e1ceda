"""Two laps of the same street: landmarks observed again after a long time make a band full."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import O, X
from synthetic_bundle import TIGHT, drive, total_cost, with_loss
from synthetic_laps import LAP, ring, two_laps
from synthetic_states import drive_with_states

from vgps.solver.bundle_adjustment import solve
from vgps.solver.equations import elimination
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.graph_optimiser import optimise_graph
from vgps.solver.gtsam_graphs.gtsam_export import to_graph
from vgps.solver.marginals import marginal_covariances
from vgps.solver.matrices.band_matrix import BandMatrix
from vgps.solver.matrices.block_matrix import BlockSparseMatrix
from vgps.solver.state_vectors import StateVector


def force_band(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(elimination, "_CHEAP_BAND_FLOPS", 1e30)


@pytest.fixture
def blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks are used, however small the problem is."""
    monkeypatch.setattr(elimination, "_CHEAP_BAND_FLOPS", 0.0)
    monkeypatch.setattr(elimination, "_BLOCK_SLOWDOWN", 0.0)


def test_second_lap_is_cheaper_in_blocks(blocks: None, monkeypatch: pytest.MonkeyPatch) -> None:
    problem = two_laps()
    structure = analyse_sparsity(problem)
    assert structure.blocks is not None and isinstance(structure.empty(), BlockSparseMatrix)
    assert structure.half_bandwidth > 6 * LAP
    force_band(monkeypatch)
    band = analyse_sparsity(problem)
    assert band.blocks is None and isinstance(band.empty(), BandMatrix)
    assert structure.flops < 0.5 * band.flops
    assert 16.0 * structure.blocks.size < structure.bytes < band.bytes


def test_blocks_are_chosen_where_they_are_faster_landmarks_included(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = two_laps()
    force_band(monkeypatch)
    band = analyse_sparsity(problem)
    monkeypatch.setattr(elimination, "_CHEAP_BAND_FLOPS", 0.0)
    monkeypatch.setattr(elimination, "_BLOCK_SLOWDOWN", 0.0)
    flops = analyse_sparsity(problem).flops
    ratio, without_landmarks = band.flops / flops, replace(band, chunks=()).flops / flops
    assert without_landmarks < 0.95 * ratio
    for slowdown, in_blocks in (
        (0.99 * without_landmarks, True),
        (0.99 * ratio, True),
        (1.01 * ratio, False),
    ):
        monkeypatch.setattr(elimination, "_BLOCK_SLOWDOWN", slowdown)
        assert (analyse_sparsity(problem).blocks is not None) == in_blocks


@pytest.mark.slow
def test_minimum_of_two_laps_is_that_of_gtsam(blocks: None) -> None:
    problem = two_laps()
    result, reference = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert result.solver == "schur" and result.converged
    assert total_cost(result.problem) == pytest.approx(total_cost(reference.problem), rel=1e-8)
    np.testing.assert_allclose(
        result.problem.world_T_camera, reference.problem.world_T_camera, rtol=0, atol=1e-6
    )
    assert total_cost(result.problem) < 0.1 * total_cost(problem)


@pytest.mark.slow
def test_blocks_and_band_take_the_same_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = two_laps()
    force_band(monkeypatch)
    assert analyse_sparsity(problem).blocks is None
    band = solve(problem, replace(TIGHT, max_iterations=3))
    monkeypatch.setattr(elimination, "_CHEAP_BAND_FLOPS", 0.0)
    monkeypatch.setattr(elimination, "_BLOCK_SLOWDOWN", 0.0)
    assert analyse_sparsity(problem).blocks is not None
    in_blocks = solve(problem, replace(TIGHT, max_iterations=3))
    np.testing.assert_allclose(in_blocks.problem.world_T_camera, band.problem.world_T_camera, atol=1e-9)
    np.testing.assert_allclose(in_blocks.problem.world_p_landmark, band.problem.world_p_landmark, atol=1e-7)


@pytest.mark.slow
def test_the_result_in_blocks_does_not_depend_on_the_number_of_threads(
    blocks: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vgps.solver.equations.chunks.CHUNK_OBSERVATIONS", 100)
    ends = []
    for threads in (1, 3):
        monkeypatch.setattr("vgps.runtime.threads.usable_cores", lambda threads=threads: threads)
        ends.append(solve(two_laps(), replace(TIGHT, max_iterations=3)).problem)
    np.testing.assert_array_equal(ends[0].world_T_camera, ends[1].world_T_camera)
    np.testing.assert_array_equal(ends[0].world_p_landmark, ends[1].world_p_landmark)


@pytest.mark.slow
def test_held_frames_and_robust_losses_in_blocks(blocks: None) -> None:
    problem = two_laps()
    held = np.zeros(2 * LAP, dtype=bool)
    held[[0, 1, 40, 80, 81]] = True
    start = problem.world_T_camera.copy()
    start[held] = ring(2)[held]
    problem = replace(problem, world_T_camera=start, fixed=held)
    problem = with_loss(problem, "huber", 1.5)
    assert analyse_sparsity(problem).blocks is not None
    result, reference = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert total_cost(result.problem) == pytest.approx(total_cost(reference.problem), rel=1e-8)
    np.testing.assert_array_equal(result.problem.world_T_camera[held], problem.world_T_camera[held])


@pytest.mark.slow
def test_covariances_in_blocks_equal_gtsams_marginals(blocks: None) -> None:
    problem = solve(two_laps(), TIGHT).problem
    assert analyse_sparsity(problem).blocks is not None
    marginals = gtsam.Marginals(*to_graph(problem))
    expected = np.stack([marginals.marginalCovariance(X(i)) for i in range(2 * LAP)])
    found = marginal_covariances(problem).poses
    size = np.sqrt(np.einsum("fii->fi", expected))
    np.testing.assert_allclose((found - expected) / size[:, :, None] / size[:, None, :], 0.0, atol=1e-6)


@pytest.mark.slow
def test_graph_interface_uses_blocks(blocks: None) -> None:
    problem = two_laps()
    found = optimise_graph(*to_graph(problem), TIGHT)
    assert found.solver == "schur"
    assert found.error_after == pytest.approx(total_cost(solve(problem, TIGHT, "gtsam").problem), rel=1e-8)


def test_short_drive_is_stored_as_a_band() -> None:
    problem, _ = drive(frames=20, landmarks=100)
    structure = analyse_sparsity(problem)
    assert structure.blocks is None
    span = max(np.ptp(problem.frame[problem.landmark == row]) for row in np.unique(problem.landmark))
    assert structure.half_bandwidth == 6 * (span + 1) - 1


def test_held_frames_are_not_numbered() -> None:
    problem, _ = drive(frames=6, landmarks=30)
    structure = analyse_sparsity(replace(problem, fixed=np.isin(np.arange(6), [0, 3])))
    np.testing.assert_array_equal(structure.free, [-1, 0, 1, -1, 2, 3])
    assert structure.n_free == 4


def test_limits_apply_to_operations_and_to_memory() -> None:
    structure = analyse_sparsity(drive(frames=12, landmarks=60)[0])
    assert structure.fits(structure.flops, structure.bytes)
    assert not structure.fits(0.99 * structure.flops, structure.bytes)
    assert not structure.fits(structure.flops, 0.99 * structure.bytes)


def test_pose_factor_between_distant_frames_widens_the_band() -> None:
    problem, _ = drive(frames=30, landmarks=100)
    graph = gtsam.NonlinearFactorGraph(problem.pose_graph)
    graph.add(gtsam.BetweenFactorPose3(X(0), X(29), gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6)))
    assert analyse_sparsity(replace(problem, pose_graph=graph)).half_bandwidth == 6 * 30 - 1


@pytest.mark.slow
def test_states_in_blocks_have_the_minimum_and_the_covariances_of_a_band(blocks: None) -> None:
    problem = drive_with_states()
    assert analyse_sparsity(problem).blocks is not None
    result, reference = solve(problem, TIGHT).problem, solve(problem, TIGHT, "gtsam").problem
    assert total_cost(result) == pytest.approx(total_cost(reference), rel=1e-9)
    marginals, found = gtsam.Marginals(*to_graph(result)), marginal_covariances(result)
    for key, block in found.states.items():
        np.testing.assert_allclose(block, marginals.marginalCovariance(key), rtol=1e-5, atol=1e-9)


def test_states_widen_a_band_by_no_more_than_those_within_a_track() -> None:
    problem, _ = drive()
    offsets = {O(k): StateVector(np.zeros(3), 5 * k) for k in range(8)}
    narrow, wide = analyse_sparsity(problem), analyse_sparsity(replace(problem, states=offsets))
    assert wide.n_free == narrow.n_free + 8
    # a track of at most 25 frames contains at most five
    assert 0 < wide.half_bandwidth - narrow.half_bandwidth <= 30
