"""Two laps of the same street: landmarks seen again after a long time, which no band holds."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X
from synthetic_bundle import K, visible

from vgps.solver import elimination
from vgps.solver.block_matrix import BlockSparseMatrix
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.cost import cost_terms
from vgps.solver.elimination import analyze_sparsity
from vgps.solver.graph_optimizer import optimise_graph
from vgps.solver.gtsam_export import to_graph
from vgps.solver.marginals import marginal_covariances
from vgps.solver.problem import BundleProblem

TIGHT = SolverSettings(relative_tolerance=1e-13, absolute_tolerance=1e-13)
LAP = 72  # frames


def ring(laps: int) -> np.ndarray:
    """(F, 4, 4) poses on a circle of 30 m, looking ahead and out; the second lap a little to the side."""
    angle = 2 * np.pi * np.arange(laps * LAP) / LAP
    radius = 30.0 + 0.4 * (np.arange(laps * LAP) // LAP)
    poses = np.tile(np.eye(4), (laps * LAP, 1, 1))
    poses[:, :3, :3] = [gtsam.Rot3.Ry(-a - 0.2).matrix() for a in angle]
    poses[:, :3, 3] = np.stack(
        [radius * np.cos(angle), 0.1 * np.sin(3 * angle), radius * np.sin(angle)], axis=1
    )
    return poses


def two_laps(landmarks: int = 260, seed: int = 0) -> BundleProblem:
    """Each point is seen for some frames of the first lap, most also in the second; held by a few fixes."""
    rng = np.random.default_rng(seed)
    poses = ring(2)
    points, rows = np.zeros((landmarks, 3)), []
    for landmark in range(landmarks):
        first, length = int(rng.integers(0, LAP)), int(rng.integers(4, 9))
        ray = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.4, 0.4), 1.0]) * rng.uniform(6.0, 20.0)
        points[landmark] = poses[first, :3, :3] @ ray + poses[first, :3, 3]
        for start in (first, first + LAP)[: 1 + int(rng.random() < 0.7)]:
            frames, uv = visible(poses, points[landmark], start, start + length)
            rows.append((frames, np.full(len(frames), landmark), uv))
    frame, landmark, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    keep = np.bincount(landmark, minlength=landmarks)[landmark] >= 3
    graph = gtsam.NonlinearFactorGraph()
    fix = gtsam.noiseModel.Isotropic.Sigma(3, 0.1)
    for i in range(0, 2 * LAP, 12):
        graph.add(gtsam.GPSFactor(X(i), poses[i, :3, 3] + rng.normal(0, 0.1, 3), fix))
    loose = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.1, 0.1, 0.1, 1.0, 1.0, 1.0]))
    for i in range(2 * LAP - 1):
        motion = gtsam.Pose3(poses[i]).between(gtsam.Pose3(poses[i + 1]))
        graph.add(gtsam.BetweenFactorPose3(X(i), X(i + 1), motion, loose))
    shift = rng.normal(size=(2 * LAP, 6)) * [0.003, 0.003, 0.003, 0.1, 0.1, 0.1]
    start = np.stack([gtsam.Pose3(T).retract(d).matrix() for T, d in zip(poses, shift, strict=True)])
    noisy = uv[keep] + rng.normal(0, 0.5, uv[keep].shape)
    sigma = np.full(int(keep.sum()), 2.0)
    near = points + rng.normal(0, 0.2, points.shape)
    return BundleProblem(
        K=K,
        world_T_camera=start,
        world_p_landmark=near,
        frame=frame[keep],
        landmark=landmark[keep],
        uv_px=noisy,
        sigma_px=sigma,
        pose_graph=graph,
    )


@pytest.fixture
def tiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tiles are looked into however small the problem is."""
    monkeypatch.setattr(elimination, "_CHEAP_BAND_FLOPS", 0.0)
    monkeypatch.setattr(elimination, "_BLOCK_SLOWDOWN", 0.0)


def total(problem: BundleProblem) -> float:
    return sum(cost_terms(problem).values())


def test_the_second_lap_makes_tiles_of_the_band(tiled: None) -> None:
    problem = two_laps()
    structure = analyze_sparsity(problem)
    assert structure.blocks is not None and isinstance(structure.empty(), BlockSparseMatrix)
    assert structure.half_bandwidth > 6 * LAP
    band = elimination._band_structure(problem, structure.free, [])
    assert structure.flops < 0.5 * band.flops and structure.bytes < band.bytes


def test_two_laps_end_where_gtsam_ends(tiled: None) -> None:
    problem = two_laps()
    ours, theirs = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert ours.solver == "schur" and ours.converged
    assert total(ours.problem) == pytest.approx(total(theirs.problem), rel=1e-8)
    np.testing.assert_allclose(ours.problem.world_T_camera, theirs.problem.world_T_camera, rtol=0, atol=1e-6)
    assert total(ours.problem) < 0.1 * total(problem)


def test_tiles_and_band_take_the_same_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = two_laps()
    monkeypatch.setattr(elimination, "_CHEAP_BAND_FLOPS", 1e30)
    assert analyze_sparsity(problem).blocks is None
    band = solve(problem, replace(TIGHT, max_iterations=3))
    monkeypatch.setattr(elimination, "_CHEAP_BAND_FLOPS", 0.0)
    monkeypatch.setattr(elimination, "_BLOCK_SLOWDOWN", 0.0)
    assert analyze_sparsity(problem).blocks is not None
    tiles = solve(problem, replace(TIGHT, max_iterations=3))
    np.testing.assert_allclose(tiles.problem.world_T_camera, band.problem.world_T_camera, atol=1e-9)
    np.testing.assert_allclose(tiles.problem.world_p_landmark, band.problem.world_p_landmark, atol=1e-7)


def test_held_frames_and_robust_losses_in_tiles(tiled: None) -> None:
    problem = two_laps()
    held = np.zeros(2 * LAP, dtype=bool)
    held[[0, 1, 40, 80, 81]] = True
    start = problem.world_T_camera.copy()
    start[held] = ring(2)[held]
    problem = replace(problem, world_T_camera=start, fixed=held)
    problem = replace(problem, robust="huber", robust_k=np.full(len(problem.frame), 1.5))
    assert analyze_sparsity(problem).blocks is not None
    ours, theirs = solve(problem, TIGHT), solve(problem, TIGHT, "gtsam")
    assert total(ours.problem) == pytest.approx(total(theirs.problem), rel=1e-8)
    np.testing.assert_array_equal(ours.problem.world_T_camera[held], problem.world_T_camera[held])


def test_covariances_in_tiles_are_gtsams_marginals(tiled: None) -> None:
    problem = solve(two_laps(), TIGHT).problem
    assert analyze_sparsity(problem).blocks is not None
    marginals = gtsam.Marginals(*to_graph(problem))
    expected = np.stack([marginals.marginalCovariance(X(i)) for i in range(2 * LAP)])
    found = marginal_covariances(problem).poses
    size = np.sqrt(np.einsum("fii->fi", expected))
    np.testing.assert_allclose((found - expected) / size[:, :, None] / size[:, None, :], 0.0, atol=1e-6)


def test_the_graph_interface_takes_loops_too(tiled: None) -> None:
    problem = two_laps()
    found = optimise_graph(*to_graph(problem), TIGHT)
    assert found.solver == "schur"
    assert found.error_after == pytest.approx(total(solve(problem, TIGHT, "gtsam").problem), rel=1e-8)
