"""Drawn covariances: equal to the marginals for independent errors, and realistic for correlated ones."""

from dataclasses import replace
from functools import cache

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import O
from synthetic_bundle import ANTENNA as CAMERA_P_ANTENNA
from synthetic_bundle import drive
from synthetic_fixes import fixes_of_size
from synthetic_states import offset_fix, walk

from vgps.config import DriftConfig, GpsConfig
from vgps.errors import GeometryError
from vgps.gps.fix_factors import gps_graph
from vgps.gps.sensors import Sensors
from vgps.smoothing.sigmas.covariance import ErrorSources, drawn_covariances
from vgps.solver.bundle_adjustment import SolverSettings, solve
from vgps.solver.cost import reprojection_errors
from vgps.solver.equations.elimination import analyse_sparsity
from vgps.solver.marginals import marginal_covariances
from vgps.solver.state_vectors import StateVector

INTERVAL_S = 0.1
SIGMA_M = 0.05
REGION = SIGMA_M * np.sqrt(-2 * np.log(0.05)), SIGMA_M * 1.96  # leave 5 % of Gaussian errors outside
GAUSSIAN = GpsConfig(model="gaussian", gaussian_sigma_m=SIGMA_M)


def fixes_of(poses, rng, correlation_s=1e-3):
    """A fix every four frames, with white errors, whose class says how large they are."""
    row = np.arange(0, len(poses) - 1, 4)
    n = len(row)
    antenna = poses[row, :3, 3] + poses[row, :3, :3] @ CAMERA_P_ANTENNA
    place = antenna + rng.normal(0.0, SIGMA_M, (n, 3))
    r_m, h_m = np.full(n, REGION[0]), np.full(n, REGION[1])
    return fixes_of_size(INTERVAL_S * row, place, r_m, h_m, correlation_s=np.full(n, correlation_s))


@cache
def optimum(slip_px=0.0, seed=0, noise_px=0.3, frames=40):
    """A solved drive, its true poses and the sources of its errors; tracks slip by ``slip_px`` as a whole."""
    rng = np.random.default_rng(seed)
    problem, poses = drive(frames, 500, seed=seed, disturbed=0.0)
    exact = problem.uv_px + reprojection_errors(problem)[0]
    slip = rng.normal(0.0, slip_px, (len(problem.world_p_landmark), 2))
    # a slip that a shift of the landmark explains would be no error of the pose
    ramp = (problem.frame - problem.frame.mean()) / frames
    noise = rng.normal(0.0, noise_px, problem.uv_px.shape) + slip[problem.landmark] * ramp[:, None]
    fixes = fixes_of(poses, rng)
    times = INTERVAL_S * np.arange(frames)
    gps = gps_graph(fixes, times, Sensors.fixed(CAMERA_P_ANTENNA), GAUSSIAN)
    sigma_px = np.full(len(problem.frame), noise_px)
    given = replace(problem, uv_px=exact + noise, sigma_px=sigma_px, robust="none", pose_graph=gps)
    sources = ErrorSources(
        gps=gps, others=gtsam.NonlinearFactorGraph(), fixes=fixes, camera_sigma=np.zeros(4)
    )
    return solve(given, SolverSettings(relative_tolerance=1e-10)).problem, poses, sources


def nees(problem, poses, covariance):
    """Mean over frames and axes of the squared position errors over their variances."""
    error = np.einsum("fji,fj->fi", poses[:, :3, :3], problem.world_T_camera[:, :3, 3] - poses[:, :3, 3])
    return np.mean(error**2 / np.diagonal(covariance[:, 3:, 3:], axis1=1, axis2=2))


@pytest.mark.slow
def test_independent_errors_give_the_marginals():
    problem, _, sources = optimum()
    drawn = drawn_covariances(problem, sources, draws=2000, seed=1).poses
    marginal = marginal_covariances(problem).poses
    ratio = np.diagonal(drawn, axis1=1, axis2=2) / np.diagonal(marginal, axis1=1, axis2=2)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    assert ratio.min() > 0.7 and ratio.max() < 1.4


@pytest.mark.slow
def test_submaps_draw_a_few_at_a_time(monkeypatch):
    problem, _, sources = optimum(frames=160)
    cut = replace(problem, submap_frames=60)
    assert analyse_sparsity(cut).submaps is not None
    monkeypatch.setattr("vgps.smoothing.sigmas.covariance._STEPS_AT_ONCE", 6 * 160 * 200)
    drawn = drawn_covariances(cut, sources, draws=500, seed=1).poses
    whole = drawn_covariances(problem, sources, draws=500, seed=1).poses
    assert not np.allclose(drawn, whole)  # other random numbers: the draws were not made at once
    ratio = np.diagonal(drawn, axis1=1, axis2=2) / np.diagonal(whole, axis1=1, axis2=2)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)
    assert ratio.min() > 0.6 and ratio.max() < 1.6


@pytest.mark.slow
def test_errors_common_to_a_track_are_in_the_covariance_and_not_in_the_marginals():
    honest, curvature = [], []
    for seed in range(6):
        problem, poses, sources = optimum(slip_px=25.0, seed=seed)
        honest.append(nees(problem, poses, drawn_covariances(problem, sources, 300, 1).poses))
        curvature.append(nees(problem, poses, marginal_covariances(problem).poses))
    assert 0.4 < np.mean(honest) < 2.0
    assert np.mean(curvature) > 3.0 * np.mean(honest)


def test_the_weight_of_a_factor_does_not_change_how_large_a_fix_errs():
    problem, _, sources = optimum()
    doubled = drawn_covariances(
        problem, replace(sources, fixes=replace(sources.fixes, r_m=2 * sources.fixes.r_m)), 500, 1
    ).poses
    once = drawn_covariances(problem, sources, 500, 1).poses
    # the drive is level and looks along the third axis
    along = [np.sqrt(doubled[:, i, i] / once[:, i, i]).mean() for i in (3, 4, 5)]
    assert min(along[:2]) > 1.5 and max(along[:2]) < 2.01 and along[2] < 1.2


def test_same_seed_same_draws():
    problem, _, sources = optimum()
    once, again = (drawn_covariances(problem, sources, 50, 7).poses for _ in range(2))
    np.testing.assert_array_equal(once, again)


def test_undetermined_poses_are_refused():
    problem, _, sources = optimum()
    loose = replace(problem, pose_graph=gtsam.NonlinearFactorGraph())
    empty = replace(sources, gps=gtsam.NonlinearFactorGraph(), fixes=sources.fixes.until(-1.0))
    with pytest.raises(GeometryError, match="not determined"):
        drawn_covariances(loose, empty, 10, 0)


@pytest.mark.slow
def test_independent_errors_give_the_marginals_of_states():
    """An offset every five frames, all fixes with an offset; the walk is linear."""
    problem, poses, sources = optimum()
    gps, kept = gtsam.NonlinearFactorGraph(), np.arange(0, 39, 4)
    for i in kept.tolist():
        gps.push_back(offset_fix(i, poses[i, :3, 3] + 0.1))
    both = gtsam.NonlinearFactorGraph(gps)
    both.push_back(walk(8, robust=False))
    states = {O(k): StateVector(np.zeros(3), 5 * k) for k in range(8)}
    problem = solve(replace(problem, pose_graph=both, states=states)).problem
    sources = replace(sources, gps=gps, others=walk(8, robust=False))
    drawn = drawn_covariances(problem, sources, draws=2000, seed=1)
    marginal = marginal_covariances(problem)
    assert drawn.states.keys() == states.keys()
    ratio = [np.diagonal(drawn.states[key]) / np.diagonal(marginal.states[key]) for key in states]
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1) and 0.7 < np.min(ratio) <= np.max(ratio) < 1.4
    of_poses = [np.diagonal(c.poses, axis1=1, axis2=2) for c in (drawn, marginal)]
    assert np.median(of_poses[0] / of_poses[1]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("parameter", "sigma"), [(0, 2e-4), (1, 0.1), (2, 0.1), (3, 1e-3)])
def test_an_error_of_the_calibration_moves_the_poses_as_drawn(parameter, sigma):
    """The drawn standard deviation is the shift of the optimum with a calibration off by one sigma."""
    problem, _, sources = optimum(noise_px=1e-3)
    camera_sigma = np.eye(4)[parameter] * sigma
    exact = replace(sources.fixes, r_m=sources.fixes.r_m * 1e-9, h_m=sources.fixes.h_m * 1e-9)
    sources = replace(sources, fixes=exact)

    def variance(sigmas):
        drawn = drawn_covariances(problem, replace(sources, camera_sigma=sigmas), draws=2000, seed=0)
        return np.diagonal(drawn.poses, axis1=1, axis2=2)

    fx, fy, cx, cy = problem.K

    def with_error(sign):
        scale, shift = np.exp(sign * camera_sigma[0]), sign * camera_sigma[1:3]
        ray = (problem.uv_px - [cx, cy]) / [fx, fy]
        distorted = sign * camera_sigma[3] * np.sum(ray**2, axis=1)[:, None] * ray * [fx, fy]
        K = scale * fx, scale * fy, cx + shift[0], cy + shift[1]
        off = replace(problem, K=K, uv_px=problem.uv_px - distorted)
        tight = SolverSettings(relative_tolerance=1e-15, absolute_tolerance=1e-15)
        return solve(off, tight).problem.world_T_camera

    pairs = zip(with_error(-5.0), with_error(5.0), strict=True)  # far beyond the rounding of the optimum
    ends = [gtsam.Pose3(minus).localCoordinates(gtsam.Pose3(plus)) for minus, plus in pairs]
    delta = 0.1 * np.array(ends)
    # rotation and translation of each frame; single axes may be weakly determined
    found, moved = (
        values.reshape(-1, 2, 3).sum(axis=2)
        for values in (variance(camera_sigma) - variance(np.zeros(4)), delta**2)
    )
    np.testing.assert_allclose(np.median(np.sqrt(found / moved), axis=0), 1.0, atol=0.2)


def test_drift_of_the_video_is_what_the_fixes_do_not_take_back():
    """It grows with the distance from the last fix, and is zero without drift."""
    problem, _, sources = optimum(frames=60)
    times = INTERVAL_S * np.arange(60)
    first = sources.fixes.until(2.0)
    gps = gps_graph(first, times, Sensors.fixed(CAMERA_P_ANTENNA), GAUSSIAN)
    problem = replace(problem, pose_graph=gps)
    sources = replace(sources, gps=gps, fixes=first)

    def sigma_m(drift):
        drawn = drawn_covariances(problem, replace(sources, drift=drift), 300, 1).poses
        return np.sqrt(np.trace(drawn[:, 3:, 3:], axis1=1, axis2=2))

    without, with_drift = sigma_m(None), sigma_m(DriftConfig())
    np.testing.assert_allclose(with_drift[:20], without[:20], rtol=0.5, atol=0.02)
    # over 24 m behind the fixes log scale and rotation walk 40 frames, to about 2.5 % and 0.15 degrees
    beyond = np.sqrt(with_drift[-1] ** 2 - without[-1] ** 2)
    assert 0.2 < beyond < 0.8


def test_noise_errs_by_its_ratio():
    problem, _, sources = optimum()
    noise, none = sources.gps, gtsam.NonlinearFactorGraph()
    rows = np.ones(noise.size())
    fixes = sources.fixes.until(-1.0)

    def sigma(ratio):
        changed = replace(sources, gps=none, fixes=fixes, noise=noise, noise_ratio=ratio * rows)
        return np.sqrt(np.median(np.diagonal(drawn_covariances(problem, changed, 500, 1).poses[:, 3:, 3:])))

    assert sigma(40.0) == pytest.approx(2.0 * sigma(20.0), rel=0.1)


def test_an_error_of_the_gps_clock_moves_all_poses_along_the_path():
    problem, poses, sources = optimum()
    moved_m = 0.4 * np.gradient(poses[:, :3, 3], axis=0)
    known, late = (
        drawn_covariances(problem, replace(sources, clock_m=clock_m), draws=2000, seed=1).poses[:, 3:, 3:]
        for clock_m in (np.zeros((0, *moved_m.shape)), moved_m[None])
    )
    along = np.einsum("fji,fj->fi", poses[:, :3, :3], moved_m)
    more = np.einsum("fi,fij,fj->f", along, late - known, along) / np.sum(along**2, axis=1) ** 2
    assert np.median(more) == pytest.approx(1.0, abs=0.15) and more.min() > 0.5 and more.max() < 1.5
