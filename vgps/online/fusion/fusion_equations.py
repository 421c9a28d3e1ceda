"""Residuals and normal equations of the graph of live poses, and their minimum.

Everything is a chain, so that the matrix is block tridiagonal. Losses of Student's t are reweighted.
"""

from dataclasses import dataclass

import numpy as np

from vgps.geometry import cross_matrices, rotation_matrices, rotation_vectors
from vgps.model import FloatArray
from vgps.online.fusion.block_system import BlockSum, BlockSystem
from vgps.online.fusion.fusion_nodes import FusionNodes
from vgps.online.fusion.place_ties import ROBUST

POSITION, SCALE, ROTATION, OFFSET, BIAS = slice(0, 3), 3, slice(4, 7), slice(7, 10), slice(10, 12)
MEAN_ROLL, TIME_OFFSET, ANTENNA, UNKNOWNS = 10, 12, slice(13, 16), 16
_HALVINGS = 8
_MIN_DECREASE = 1e-4  # relative decrease of the cost that ends the iteration
_ANYWHERE_M, _ANY_SCALE, _ANY_ROTATION_RAD = 100.0, 1.0, 1.0  # of the first node before any fit
_HELD = 1e-4  # changes of biases [rad], time offset [s] and lever arm [m] from node to node


@dataclass(frozen=True)
class FusionState:
    """Unknowns of the nodes.

    Attributes:
        values: (N, 16) position, log scale, zeros, offset, bias of the elevations, what remains of the time
            offset, and lever arm; increments of the rotation stand at the zeros.
        world_R_map: (N, 3, 3) rotation of the video's axes.
    """

    values: FloatArray
    world_R_map: FloatArray

    def moved(self, step: FloatArray) -> "FusionState":
        """Return the state moved by increments (N, 16)."""
        values = self.values + step
        values[:, ROTATION] = 0.0
        return FusionState(values, rotation_matrices(step[:, ROTATION]) @ self.world_R_map)


@dataclass(frozen=True)
class FirstNodePrior:
    """What is known of the first node, ``d^T information d / 2 + vector^T d``, d its distance from ``at``."""

    at: FusionState
    information: FloatArray
    vector: FloatArray

    def distance(self, state: FusionState) -> FloatArray:
        """Return d (16,) of a state's first node."""
        d = state.values[0] - self.at.values[0]
        d[ROTATION] = rotation_vectors(state.world_R_map[:1] @ self.at.world_R_map[0].T)[0]
        return np.asarray(d)

    def cost(self, state: FusionState) -> float:
        """Return its cost."""
        d = self.distance(state)
        return float(0.5 * d @ self.information @ d + self.vector @ d)


def vague_prior(state: FusionState, bias_rad: FloatArray, antenna: FloatArray) -> FirstNodePrior:
    """Return next to nothing about the first node but biases (2,) of the elevations with these sigmas, and a
    lever arm with this covariance (3, 3)."""
    known = np.zeros(UNKNOWNS)
    known[POSITION], known[SCALE] = _ANYWHERE_M**-2, _ANY_SCALE**-2
    known[ROTATION], known[BIAS] = _ANY_ROTATION_RAD**-2, bias_rad**-2
    information = np.diag(known)
    information[ANTENNA, ANTENNA] = np.linalg.inv(antenna)
    at = FusionState(state.values[:1], state.world_R_map[:1])
    return FirstNodePrior(at, information, np.zeros(UNKNOWNS))


@dataclass(frozen=True)
class _Residuals:
    """Residuals of all factors, parts of their derivatives, and squared noise and walk in their scales."""

    video_step: FloatArray
    step_information: FloatArray
    step: FloatArray
    turn: FloatArray
    fix_lever: FloatArray
    fix_velocity: FloatArray
    fix_axes: FloatArray
    fix: FloatArray
    elevation: FloatArray
    axes: FloatArray
    tie: FloatArray
    noise: FloatArray
    walk: FloatArray


def _residuals(nodes: FusionNodes, state: FusionState) -> _Residuals:
    x, R, fixes = state.values, state.world_R_map, nodes.fixes
    turn = rotation_vectors(R[1:] @ R[:-1].transpose(0, 2, 1))
    middle = rotation_matrices(0.5 * turn) @ R[:-1]
    scale = np.exp(0.5 * (x[1:, SCALE] + x[:-1, SCALE]))
    video = np.diff(nodes.camera[:, :3, 3], axis=0)
    video_step = scale[:, None] * (middle @ video[:, :, None])[:, :, 0]
    at = fixes.node
    velocity, change_s = fixes.velocity, x[at, TIME_OFFSET] - fixes.time_offset_s
    step = fixes.step - velocity * change_s[:, None]
    placed = np.exp(x[at, SCALE])[:, None, None] * (R[at] @ np.stack([step, velocity], axis=2))
    away = placed[:, :, 0]
    fix_axes = R[at] @ fixes.axes
    arm = (fix_axes @ x[at, ANTENNA, None])[:, :, 0]
    axes = R @ nodes.axes
    fix = x[at, POSITION] + away + arm + x[at, OFFSET] - fixes.world_p_fix
    return _Residuals(
        video_step,
        nodes.drift.step_information(video_step),
        np.diff(x[:, POSITION], axis=0) - video_step,
        turn,
        np.stack([away, away + arm], axis=1),
        placed[:, :, 1],
        fix_axes,
        fix,
        axes[:, 2] - nodes.elevation - x[:, BIAS],
        axes,
        _tie_residuals(nodes, state),
        np.sum((fix / fixes.noise_m) ** 2, axis=1),
        np.sum((np.diff(x[:, OFFSET], axis=0) / nodes.walk_m[1:]) ** 2, axis=1),
    )


def _tie_residuals(nodes: FusionNodes, state: FusionState) -> FloatArray:
    """Return position and rotation (K, 6) against those by places seen again, in standard deviations."""
    at, there = nodes.tied, nodes.ties.world_T_camera
    if not len(at):
        return np.zeros((0, 6))
    R = state.world_R_map[at] @ nodes.camera[at, :3, :3] @ there[:, :3, :3].transpose(0, 2, 1)
    away = state.values[at, POSITION] - there[:, :3, 3]
    return np.hstack([away, rotation_vectors(R)]) / nodes.ties.sigma


def squared_deviations(nodes: FusionNodes, state: FusionState) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Return times and squared deviations, in scales, of noise of fixes, walk to nodes, and bounds."""
    r = _residuals(nodes, state)
    bound = np.sum((state.values[:, OFFSET] * nodes.bound) ** 2, axis=1)
    return (nodes.t_s[nodes.fixes.node], r.noise), (nodes.t_s[1:], r.walk), (nodes.t_s, bound)


def cost(nodes: FusionNodes, state: FusionState, prior: FirstNodePrior) -> float:
    """Return the negative log-likelihood up to a constant."""
    return _cost(nodes, state, prior, _residuals(nodes, state))


def _cost(nodes: FusionNodes, state: FusionState, prior: FirstNodePrior, r: _Residuals) -> float:
    x, drift = state.values, nodes.drift
    noise, walk = r.noise, r.walk
    tail, heavy = nodes.walk_tail[1:], np.isfinite(nodes.walk_tail[1:])
    total = np.einsum("ni,nij,nj->", r.step, r.step_information, r.step)
    total += np.sum((np.diff(x[:, SCALE]) / drift.scale) ** 2)
    total += np.sum((np.diff(x[:, BIAS.start :], axis=0) / _HELD) ** 2)
    total += ((x[0, TIME_OFFSET] - nodes.time_offset.time_offset_s) / nodes.time_offset.sigma_s) ** 2
    total += np.sum((r.turn / drift.rotation[:, None]) ** 2)
    total += np.sum((nodes.fixes.tail + 3.0) * np.log1p(noise / nodes.fixes.tail))
    total += np.sum(walk[~heavy]) + np.sum((tail[heavy] + 3.0) * np.log1p(walk[heavy] / tail[heavy]))
    total += np.sum((x[:, OFFSET] * nodes.bound) ** 2) + np.sum((r.elevation * nodes.level) ** 2)
    total += ROBUST * np.sum(np.log1p(np.sum(r.tie**2, axis=1) / ROBUST))
    return float(0.5 * total + np.log1p((x[0, MEAN_ROLL] / nodes.mean_roll) ** 2)) + prior.cost(state)


def normal_equations(nodes: FusionNodes, state: FusionState, prior: FirstNodePrior) -> BlockSystem:
    """Return the reweighted normal equations."""
    return _normal_equations(nodes, state, prior, _residuals(nodes, state))


def _normal_equations(
    nodes: FusionNodes, state: FusionState, prior: FirstNodePrior, r: _Residuals
) -> BlockSystem:
    x, count = state.values, len(nodes.t_s)
    total = BlockSum(count, UNKNOWNS)
    before, after = np.zeros((2, count - 1, 3, UNKNOWNS))
    before[:, :, POSITION], after[:, :, POSITION] = -np.eye(3), np.eye(3)
    before[:, :, SCALE] = after[:, :, SCALE] = -0.5 * r.video_step
    before[:, :, ROTATION] = after[:, :, ROTATION] = 0.5 * cross_matrices(r.video_step)
    total.add_between(before, after, r.step_information, r.step)
    _add_drift_and_walk(total, nodes, state, r)
    J = np.zeros((len(r.fix), 3, UNKNOWNS))
    J[:, :, POSITION] = J[:, :, OFFSET] = np.eye(3)
    J[:, :, SCALE], J[:, :, ROTATION] = r.fix_lever[:, 0], -cross_matrices(r.fix_lever[:, 1])
    J[:, :, TIME_OFFSET], J[:, :, ANTENNA] = -r.fix_velocity, r.fix_axes
    weight = ((nodes.fixes.tail + 3.0) / (nodes.fixes.tail + r.noise))[:, None] / nodes.fixes.noise_m**2
    total.add_each(J, weight, r.fix, nodes.fixes.node)
    J = np.zeros((count, 5, UNKNOWNS))
    J[:, :3, OFFSET], J[:, 3:, BIAS] = np.eye(3), -np.eye(2)
    J[:, 3:, 4], J[:, 3:, 5] = r.axes[:, 1], -r.axes[:, 0]
    weight = np.hstack([nodes.bound, nodes.level]) ** 2
    total.add_each(J, weight, np.hstack([x[:, OFFSET], r.elevation]), np.arange(count))
    _add_ties(total, nodes, r.tie)
    _add_priors(total, nodes, state, prior)
    return BlockSystem(total.diagonal, total.below, total.gradient)


def _add_ties(total: BlockSum, nodes: FusionNodes, tie: FloatArray) -> None:
    if not len(tie):
        return
    J = np.zeros((len(tie), 6, UNKNOWNS))
    J[:, :3, POSITION] = J[:, 3:, ROTATION] = np.eye(3)
    weight = 1.0 / (1.0 + np.sum(tie**2, axis=1) / ROBUST)
    sigma = nodes.ties.sigma
    total.add_each(J, weight[:, None] / sigma**2, tie * sigma, nodes.tied)


def _add_priors(total: BlockSum, nodes: FusionNodes, state: FusionState, prior: FirstNodePrior) -> None:
    x = state.values[0]
    weight_s, prior_s = nodes.time_offset.sigma_s**-2.0, nodes.time_offset.time_offset_s
    total.diagonal[0, TIME_OFFSET, TIME_OFFSET] += weight_s
    total.gradient[0, TIME_OFFSET] += weight_s * (x[TIME_OFFSET] - prior_s)
    mean_roll_weight = 2.0 / (nodes.mean_roll**2 + x[MEAN_ROLL] ** 2)
    total.diagonal[0, MEAN_ROLL, MEAN_ROLL] += mean_roll_weight
    total.gradient[0, MEAN_ROLL] += mean_roll_weight * x[MEAN_ROLL]
    total.diagonal[0] += prior.information
    total.gradient[0] += prior.information @ prior.distance(state) + prior.vector


def _add_drift_and_walk(total: BlockSum, nodes: FusionNodes, state: FusionState, r: _Residuals) -> None:
    x, drift = state.values, nodes.drift
    change = np.column_stack([np.diff(x[:, SCALE]), r.turn, np.diff(x[:, OFFSET.start :], axis=0)])
    tail = nodes.walk_tail[1:]
    heavy, robust = np.isfinite(tail), np.ones(len(tail))
    robust[heavy] = (tail[heavy] + 3.0) / (tail[heavy] + r.walk[heavy])
    weight = np.empty_like(change)
    weight[:, :1], weight[:, 1:4] = drift.scale[:, None] ** -2.0, drift.rotation[:, None] ** -2.0
    weight[:, 4:7], weight[:, 7:] = robust[:, None] / nodes.walk_m[1:] ** 2, _HELD**-2.0
    total.add_changes(weight, change)


def minimise(nodes: FusionNodes, state: FusionState, prior: FirstNodePrior, iterations: int) -> FusionState:
    """Return the optimised state; a step that fails is halved."""
    r = _residuals(nodes, state)
    current = _cost(nodes, state, prior, r)
    for _ in range(iterations):
        step = _normal_equations(nodes, state, prior, r).step()
        for halving in range(_HALVINGS):
            trial = state.moved(step * 0.5**halving)
            r = _residuals(nodes, trial)
            trial_cost = _cost(nodes, trial, prior, r)
            if trial_cost < current:
                break
        else:
            break
        decrease, state, current = current - trial_cost, trial, trial_cost
        if decrease < _MIN_DECREASE * max(abs(current), 1.0):
            break
    return state
