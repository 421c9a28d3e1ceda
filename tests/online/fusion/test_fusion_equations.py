from dataclasses import replace

import numpy as np
import pytest
from fused_drives import ARM, DrivingCamera, fixed_then_float
from scipy.spatial.transform import Rotation
from synthetic_fixes import fixes_of_size

import vgps
from vgps.config import StartConfig
from vgps.online.fusion.fusion_equations import (
    ANTENNA,
    BIAS,
    MEAN_ROLL,
    TIME_OFFSET,
    UNKNOWNS,
    cost,
    normal_equations,
    vague_prior,
)
from vgps.online.fusion.fusion_nodes import fusion_nodes
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.live_time_offset import LiveTimeOffset
from vgps.online.fusion.node_fixes import seen_fixes
from vgps.online.fusion.path_fusion import fuse
from vgps.online.fusion.video_path import VideoPath


@pytest.fixture(scope="module")
def fit():
    drive = DrivingCamera(80)
    kinds, wrong = fixed_then_float(4, 4, [0.5, -0.4, 1.0])
    path = drive.seen(np.random.default_rng(3))
    return fuse(path, drive.fixes(kinds, wrong), ARM, vgps.Config(), None)


def dense(system):
    count = len(system.diagonal)
    matrix = np.zeros((count * UNKNOWNS,) * 2)
    for k in range(count):
        rows = slice(k * UNKNOWNS, (k + 1) * UNKNOWNS)
        matrix[rows, rows] = system.diagonal[k]
        if k:
            before = slice((k - 1) * UNKNOWNS, k * UNKNOWNS)
            matrix[rows, before], matrix[before, rows] = system.below[k - 1], system.below[k - 1].T
    return matrix


def test_the_gradient_is_that_of_the_cost(fit):
    rng = np.random.default_rng(0)
    # what hardly moves the video's steps, whose information is held in the derivative
    step = 1e-3 * rng.standard_normal((len(fit.nodes.t_s), UNKNOWNS))
    state = fit.state.moved(step)
    gradient = normal_equations(fit.nodes, state, fit.prior).gradient
    for node in (0, 3, 7):
        for unknown in (0, 2, 5, 7, 9, TIME_OFFSET, ANTENNA.start, ANTENNA.start + 2):
            delta = np.zeros_like(step)
            delta[node, unknown] = 1e-6
            ends = [cost(fit.nodes, state.moved(sign * delta), fit.prior) for sign in (-1.0, 1.0)]
            numeric = (ends[1] - ends[0]) / 2e-6
            assert gradient[node, unknown] == pytest.approx(numeric, rel=1e-3)


def test_the_prior_of_a_lever_arm_has_its_covariance(fit):
    covariance = np.diag([0.04, 0.25, 1.0])
    prior = vague_prior(fit.state, np.ones(2), covariance)
    away = np.zeros_like(fit.state.values)
    away[:, ANTENNA] = [0.1, -0.2, 0.3]
    moved = prior.cost(fit.state.moved(away)) - prior.cost(fit.state)
    assert moved == pytest.approx(0.5 * (0.1**2 / 0.04 + 0.2**2 / 0.25 + 0.3**2))


def test_the_prior_of_the_mean_roll_lets_go_of_a_camera_that_is_clearly_rolled(fit):
    rolled = np.zeros((len(fit.nodes.t_s), UNKNOWNS))
    rolled[:, MEAN_ROLL] = 0.3 - fit.state.values[:, MEAN_ROLL]
    state, nothing = fit.state.moved(rolled), replace(fit.nodes, mean_roll=np.inf)
    with_prior, without = (normal_equations(nodes, state, fit.prior) for nodes in (fit.nodes, nothing))
    gradient = with_prior.gradient[0, MEAN_ROLL] - without.gradient[0, MEAN_ROLL]
    scale = fit.nodes.mean_roll
    assert gradient == pytest.approx(2.0 * 0.3 / (scale**2 + 0.09))
    assert cost(fit.nodes, state, fit.prior) - cost(nothing, state, fit.prior) == pytest.approx(
        np.log1p((0.3 / scale) ** 2)
    )
    pull = 2.0 * scale / (scale**2 + scale**2)  # at its strongest
    assert gradient < 0.3 * pull


def test_the_gradient_is_that_of_the_cost_with_an_imu_too(fit):
    rng, count = np.random.default_rng(1), len(fit.nodes.t_s)
    nodes = replace(
        fit.nodes, elevation=0.05 * rng.standard_normal((count, 2)), level=np.full((count, 2), 30.0)
    )
    prior = replace(fit.prior, information=fit.prior.information.copy())
    prior.information[BIAS, BIAS] = 1e3 * np.eye(2)
    state = fit.state.moved(1e-3 * rng.standard_normal((count, UNKNOWNS)))
    gradient = normal_equations(nodes, state, prior).gradient
    for node in (0, 4, 7):
        for unknown in (4, 5, 10, 11):
            delta = np.zeros((count, UNKNOWNS))
            delta[node, unknown] = 1e-6
            ends = [cost(nodes, state.moved(sign * delta), prior) for sign in (-1.0, 1.0)]
            numeric = (ends[1] - ends[0]) / 2e-6
            assert gradient[node, unknown] == pytest.approx(numeric, rel=1e-3, abs=1e-2)


def test_the_minimum_has_no_gradient_and_its_covariance_is_that_of_the_whole_matrix(fit):
    system = normal_equations(fit.nodes, fit.state, fit.prior)
    matrix = dense(system)
    step = np.linalg.solve(matrix, system.gradient.ravel()).reshape(-1, UNKNOWNS)
    assert np.abs(step[:, :3]).max() < 0.01
    inverse = np.linalg.inv(matrix)[-UNKNOWNS:, -UNKNOWNS:]
    np.testing.assert_allclose(system.last_covariance(), inverse, rtol=1e-5, atol=1e-9)
    whole = np.linalg.inv(matrix).reshape(len(fit.nodes.t_s), UNKNOWNS, -1, UNKNOWNS)
    found = system.covariances()
    np.testing.assert_allclose(found, np.einsum("iaib->iab", whole), rtol=1e-4, atol=1e-8)
    each, cross = found, np.einsum("iaib->iab", whole[1:, :, :-1])
    change = each[1:] + each[:-1] - cross - cross.transpose(0, 2, 1)
    np.testing.assert_allclose(system.change_covariances(), change, rtol=1e-4, atol=1e-7)


def test_elimination_is_the_schur_complement(fit):
    system = normal_equations(fit.nodes.until(5), _first(fit.state, 6), fit.prior)
    matrix, gradient = dense(system), system.gradient.ravel()
    a, b = slice(0, -UNKNOWNS), slice(-UNKNOWNS, None)
    carried = matrix[b, a] @ np.linalg.inv(matrix[a, a])
    information, vector = system.eliminated()
    scale = np.abs(information).max()
    np.testing.assert_allclose(
        information / scale, (matrix[b, b] - carried @ matrix[a, b]) / scale, atol=1e-8
    )
    expected = gradient[b] - carried @ gradient[a]
    np.testing.assert_allclose(vector, expected, atol=1e-6 * max(np.abs(gradient).max(), 1.0))


def _first(state, count):
    return type(state)(state.values[:count], state.world_R_map[:count])


def test_nodes_lie_at_fixes_and_not_far_apart():
    drive = DrivingCamera(200)
    fixes = drive.fixes(*fixed_then_float(3, 3, np.zeros(3)))  # the last at 5 s
    path = drive.seen()
    nodes = fusion_nodes(path, seen_fixes(path, fixes, LiveTimeOffset(0.0, 0.0, 0.0)), vgps.Config())
    assert np.diff(nodes.t_s).max() <= 1.5 + 1e-9 and nodes.t_s[-1] == drive.t_s[-1]
    np.testing.assert_allclose(nodes.t_s[nodes.fixes.node], fixes.t_s)
    assert np.flatnonzero(nodes.starts).tolist() == [0, 3]
    # an offset is bounded where it starts, and hardly after that
    assert (nodes.bound[3] > 5.0 * nodes.bound[4:].max(axis=0)).all()
    assert np.isinf(nodes.walk_m[nodes.starts]).all() and np.isfinite(nodes.walk_m[~nodes.starts]).all()


@pytest.mark.parametrize("airborne, at_least_deg, at_most_deg", [("no", 10.0, 90.0), ("yes", 0.0, 1.0)])
def test_a_camera_that_flies_keeps_the_pitch_that_its_map_was_placed_with(
    airborne, at_least_deg, at_most_deg
):
    t_s, poses = 0.1 * np.arange(80), np.tile(np.eye(4), (80, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("x", -150.0, degrees=True).as_matrix()  # down by 60 degrees
    poses[:, 0, 3] = 5.0 * t_s  # sideways
    size, times_s = np.full(8, 2.0), np.full(8, 10.0)
    fixes = fixes_of_size(t_s[::10], poses[::10, :3, 3], size, size, correlation_s=times_s)
    path = VideoPath(t_s=t_s, poses=poses, moving=np.ones(80, dtype=bool))
    config = vgps.Config(start=StartConfig(airborne=airborne))
    fit = fuse(path, fixes, LeverArm.within(np.zeros(3)), config, None)
    turned_deg = np.degrees(Rotation.from_matrix(fit.state.world_R_map[-1]).magnitude())
    assert at_least_deg <= turned_deg < at_most_deg
