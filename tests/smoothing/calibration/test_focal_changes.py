"""Changes of the focal length, found in exact observations of a known scene."""

from dataclasses import replace

import numpy as np
import pytest
import synthetic_bundle
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from vgps.camera import distort, undistort
from vgps.geometry import interpolate_vectors
from vgps.model import Camera
from vgps.smoothing.calibration.focal_changes import (
    FocalEquations,
    changes_of,
    focal_equations,
    gain_of_pictures,
    is_clear,
    without_change,
)
from vgps.smoothing.calibration.parameter_step import ParameterPrior
from vgps.solver.bundle_adjustment import solve
from vgps.solver.problem import BundleProblem

FX, FY, CX, CY = synthetic_bundle.K
CAMERA = Camera(model="pinhole", width=640, height=480, fx=FX, fy=FY, cx=CX, cy=CY)
PRIOR = ParameterPrior(np.array([0.01, 5.0, 5.0]), np.zeros(3))
T_S = np.arange(40) / 5.0


def solved(log_ratio: np.ndarray, late: float = 0.0) -> BundleProblem:
    """The optimum of a drive whose pictures grow by changes (F,), with fixes late by turns, in frames."""
    problem, poses = synthetic_bundle.drive(disturbed=0.0)
    graph = synthetic_bundle.pose_factors(poses, np.random.default_rng(0))
    antenna_m = poses[:, :3, 3] + poses[:, :3, :3] @ synthetic_bundle.ANTENNA
    for frame in range(2, len(poses) - 3, 4):
        at = np.array([frame + late * np.sin(frame)])
        place_m = interpolate_vectors(np.arange(len(poses)), antenna_m, at)[0]
        graph.add(synthetic_bundle.antenna_fix(frame, 0.0, place_m, 0.01))
    uv_px = grown(problem.uv_px, log_ratio[problem.frame])
    changed = replace(problem, uv_px=uv_px, sigma_px=np.full(len(uv_px), 0.5), pose_graph=graph)
    return solve(changed, synthetic_bundle.TIGHT).problem


def solved_above_plane(log_ratio: np.ndarray) -> BundleProblem:
    """The optimum of a flight 50 m above a plane, which it sees straight below, with RTK-fixes."""
    rng, poses = np.random.default_rng(0), np.tile(np.eye(4), (len(T_S), 1, 1))
    poses[:, 0, 3], poses[:, 1, 3] = 3.0 * np.arange(len(poses)), np.sin(T_S)
    place = rng.uniform((-30.0, -20.0, 50.0), (3.0 * len(poses) + 30.0, 20.0, 50.0), (400, 3))
    seen = [synthetic_bundle.visible(poses, one, 0, len(poses) - 1) for one in place]
    counts, graph = [len(frames) for frames, _ in seen], synthetic_bundle.pose_factors(poses, rng)
    for frame in range(0, len(poses) - 1, 4):
        antenna_m = poses[frame, :3, 3] + synthetic_bundle.ANTENNA + rng.normal(0.0, 0.02, 3)
        graph.add(synthetic_bundle.antenna_fix(frame, 0.0, antenna_m, 0.02))
    frame, uv_px = np.concatenate([frames for frames, _ in seen]), np.concatenate([uv for _, uv in seen])
    uv_px = uv_px + rng.normal(0.0, 0.5, uv_px.shape)
    problem = BundleProblem(
        K=synthetic_bundle.K,
        world_T_camera=poses,
        world_p_landmark=place,
        frame=frame,
        landmark=np.repeat(np.arange(len(place)), counts),
        uv_px=grown(uv_px, log_ratio[frame]),
        sigma_px=np.full(len(frame), 0.5),
        pose_graph=graph,
    )
    return solve(problem, synthetic_bundle.TIGHT).problem


def grown(uv_px: np.ndarray, log_ratio: np.ndarray) -> np.ndarray:
    """Pixels (N, 2) of pictures that grow by changes (N,)."""
    centre = np.array([CX, CY])
    return centre + (uv_px - centre) * np.exp(log_ratio)[:, None]


def equations_of(problem: BundleProblem) -> FocalEquations:
    return focal_equations(problem, CAMERA, PRIOR, T_S)


def test_a_focal_length_that_changes_is_found():
    true = 0.01 * np.sin(T_S)
    equations = equations_of(solved(true))
    found, evidence = equations.likeliest()
    assert is_clear(evidence)
    at_knots = 0.01 * np.sin(equations.t_s)
    assert np.std(found - at_knots) < 0.5 * np.std(at_knots)


def test_one_that_stays_shows_no_change():
    found, evidence = equations_of(solved(np.zeros(len(T_S)))).likeliest()
    assert not is_clear(evidence)
    assert np.abs(found).max() < 1e-3


def test_pictures_alone_bear_out_a_change_and_contradict_what_late_fixes_ask_for():
    zoomed, late = solved(0.01 * np.sin(T_S)), solved(np.zeros(len(T_S)), late=1.5)
    for problem, sign in ((zoomed, 1.0), (late, -1.0)):
        found, evidence = equations_of(problem).likeliest()
        by_pictures = gain_of_pictures(found, problem, CAMERA, PRIOR, T_S)
        assert is_clear(evidence) and sign * by_pictures > 1.2
        assert is_clear(evidence, by_pictures) == (problem is zoomed)


def test_what_pictures_hardly_show_has_to_be_clearer():
    assert is_clear(5.0, 2.0) and is_clear(5.0)
    assert not is_clear(5.0, 0.5) and not is_clear(4.0, 2.0)
    assert is_clear(9.5, 0.5) and not is_clear(9.5, -2.0)


def test_above_flat_ground_fixes_alone_show_a_change():
    """Pictures straight down show a motion up and down as well."""
    problem = solved_above_plane(0.02 * np.sin(T_S))
    found, evidence = equations_of(problem).likeliest()
    by_pictures = gain_of_pictures(found, problem, CAMERA, PRIOR, T_S)
    assert abs(by_pictures) < 0.2 and is_clear(evidence, by_pictures)


def test_the_evidence_is_that_of_all_changes_weighed_by_their_prior():
    """Summed over a grid of changes at two knots, for the prior that makes the observations likeliest."""
    H, g = np.array([[5e5, -2e5], [-2e5, 4e5]]), np.array([9e3, -8e3])
    found, evidence = FocalEquations(np.array([0.0, 2.0]), H, g).likeliest()
    axis = np.arange(-0.12, 0.12, 2e-4)
    s = np.stack(np.meshgrid(axis, axis), axis=-1)
    log_fit = -0.5 * np.einsum("...i,ij,...j", s, H, s) - s @ g
    by_walk = []
    for walk in np.geomspace(5e-4, 0.2, 14):
        D = np.array([[-1.0, 1.0]])
        precision = D.T @ D / (2.0 * walk**2) + np.eye(2) / (3.0 * walk) ** 2
        prior = multivariate_normal(cov=np.linalg.inv(precision)).logpdf(s)
        by_walk.append((logsumexp(log_fit + prior) + 2.0 * np.log(2e-4), precision))
    best, precision = max(by_walk, key=lambda one: one[0])
    assert evidence == pytest.approx(best, abs=1e-3)
    np.testing.assert_allclose(found, -np.linalg.solve(H + precision, g))


def test_equations_of_what_is_left_give_the_same_whole():
    rng = np.random.default_rng(0)
    A, g, done = rng.normal(size=(9, 3)), rng.normal(size=3), np.array([0.01, -0.02, 0.005])
    H = 1e5 * A.T @ A
    whole = FocalEquations(np.arange(3.0), H, 1e3 * g)
    left = replace(whole, gradient=whole.gradient + H @ done)
    np.testing.assert_allclose(left.about(done).likeliest()[0], whole.likeliest()[0], rtol=1e-9)


def test_pixels_without_the_change_are_those_that_were_scaled():
    camera = replace(CAMERA, model="opencv", distortion=(-0.2, 0.05, 1e-3, -5e-4))
    rng = np.random.default_rng(0)
    uv_px, log_ratio = rng.uniform((80, 60), (560, 420), (50, 2)), rng.uniform(-0.02, 0.02, 50)
    centre = np.array([CX, CY])
    seen = centre + (distort(camera, uv_px) - centre) * np.exp(log_ratio)[:, None]
    np.testing.assert_allclose(without_change(undistort(camera, seen), camera, log_ratio), uv_px, atol=1e-6)


def test_changes_are_about_the_principal_point_and_linear_between_knots():
    equations = FocalEquations(np.array([0.0, 1.0, 2.0]), np.eye(3), np.zeros(3))
    changes = changes_of(equations, np.array([-0.02, -0.01, 0.03]), CAMERA)
    assert changes.centre_px == (CX, CY)
    np.testing.assert_allclose(changes.ratio(np.array([0.5, 2.0])), np.exp([-0.015, 0.03]))
