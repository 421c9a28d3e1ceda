"""The best estimate of a live path: the video's shape and the fixes of the last minutes, fused.

A fixed-lag smoother over the nodes of :mod:`vgps.online.fusion.fusion_nodes`: each fit starts from the last
one, and what leaves the path stays as a prior of its first node. So when RTK-float follows RTK-fix the pose
goes on with the video, and the offset of the float solution is estimated; returned RTK-fixes move the pose at
once.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vgps.config import Config
from vgps.geometry import cross_matrices, interpolate_vectors, rotation_matrices, rotation_vectors
from vgps.gps.fixes import CLASSES, Fixes
from vgps.gps.learned_errors import LearnedErrors
from vgps.mapping.map_update import Similarity
from vgps.model import BoolArray, FixClass, FloatArray, IntArray
from vgps.online.fusion.block_system import BlockSystem
from vgps.online.fusion.fusion_equations import (
    ANTENNA,
    OFFSET,
    POSITION,
    ROTATION,
    SCALE,
    TIME_OFFSET,
    UNKNOWNS,
    FirstNodePrior,
    FusionState,
    minimise,
    normal_equations,
    squared_deviations,
    vague_prior,
)
from vgps.online.fusion.fusion_nodes import FusionNodes, fusion_nodes, video_drift
from vgps.online.fusion.gravity import Gravity
from vgps.online.fusion.lever_arm import LeverArm
from vgps.online.fusion.live_time_offset import LiveTimeOffset, unseen_time_offset, with_time_offset_sigma
from vgps.online.fusion.node_fixes import SAME_TIME_S, seen_fixes
from vgps.online.fusion.unknown_time_offset import unknown_time_offset
from vgps.online.fusion.video_path import VideoPath

_ANY_ROLL_RAD, _NO_PITCH_RAD = 1.0, 1e-6  # biases of the elevations without an IMU


@dataclass(frozen=True, kw_only=True)
class FusedPath:
    """A fit.

    Attributes:
        nodes: Its nodes.
        state: Their values.
        prior: Of the first node.
        time_offset: What is believed of the rest of the time offset.
        covariance: (16, 16) of the last node.
        system: The normal equations at these values, the time offset unknown.
        learned: Noise and walk of fix classes, for the next fit.
        sizes: Offsets of fix classes over the median receiver's, for the next fit.
        carried: What the nodes before the last one with a fix say of it, if that was found.
    """

    nodes: FusionNodes
    state: FusionState
    prior: FirstNodePrior
    time_offset: LiveTimeOffset
    covariance: FloatArray
    system: BlockSystem
    learned: Mapping[FixClass, LearnedErrors] = field(default_factory=dict)
    sizes: Mapping[FixClass, float] = field(default_factory=dict)
    carried: FirstNodePrior | None = None

    @property
    def newest_s(self) -> float:
        """Time of the last node."""
        return float(self.nodes.t_s[-1])

    def to_world(self, path: VideoPath) -> Similarity:
        """Return the similarity from the map to the world at the last node and after it."""
        return self._similarity(len(self.nodes.t_s) - 1, path.at(self.nodes.t_s[-1:])[0])

    @property
    def lever_arm(self) -> LeverArm:
        """The lever arm by the prior and these fixes."""
        return LeverArm(self.state.values[-1, ANTENNA], self.covariance[ANTENNA, ANTENNA])

    @property
    def last_fix(self) -> int:
        """The last node with a fix; the first one if there are none."""
        return int(self.nodes.fixes.node.max(initial=0))

    def with_carried(self) -> "FusedPath":
        """Return the fit with what the next one, from the last fix on, would have to find."""
        return replace(self, carried=_prior_of(self, self.last_fix))

    def _similarity(self, node: int, map_T_camera: FloatArray) -> Similarity:
        x, R = self.state.values[node], self.state.world_R_map[node]
        scale = float(np.exp(x[SCALE]))
        return Similarity(scale, R, x[POSITION] - scale * R @ map_T_camera[:3, 3])

    def world_T_camera(self, path: VideoPath) -> FloatArray:
        """Return the poses (n, 4, 4) in the world of a path whose map may have changed since the fit."""
        inside = np.flatnonzero(self.nodes.t_s >= path.t_s[0] - SAME_TIME_S)
        t_s, x, R = self.nodes.t_s[inside], self.state.values[inside], self.state.world_R_map[inside]
        centre, scale = path.at(t_s)[:, :3, 3], np.exp(x[:, SCALE])
        after = np.clip(np.searchsorted(t_s, path.t_s), 0, len(t_s) - 1)
        before = np.maximum(after - 1, 0)
        span = np.maximum(t_s[after] - t_s[before], SAME_TIME_S)
        share = np.clip((path.t_s - t_s[before]) / span, 0.0, 1.0)[:, None]

        def placed(node: IntArray) -> FloatArray:
            step = path.poses[:, :3, 3] - centre[node]
            return np.asarray(x[node, POSITION] + scale[node, None] * (R[node] @ step[:, :, None])[:, :, 0])

        turn = rotation_vectors(R[after] @ R[before].transpose(0, 2, 1))
        out = path.poses.copy()
        out[:, :3, :3] = rotation_matrices(share * turn) @ R[before] @ path.poses[:, :3, :3]
        out[:, :3, 3] = (1.0 - share) * placed(before) + share * placed(after)
        return out

    def surprise(self, last: "FusedPath", since_s: float, path: VideoPath, config: Config) -> float:
        """Return the largest squared deviation, in sigmas, of what is new after a time since the last fit:
        noise, walk and bound of offsets, and the correction of the antenna's newest position."""
        deviations = squared_deviations(self.nodes, self.state)
        new = [d[t_s > since_s].max(initial=0.0) for t_s, d in deviations]
        moved_m = self.moved_from(last, path)
        covariance = last.antenna_covariance_at_end(path, config)
        return float(max(*new, moved_m @ np.linalg.solve(covariance, moved_m)))

    def moved_from(self, last: "FusedPath", path: VideoPath) -> FloatArray:
        """Return by how much (3,) the antenna's newest position differs from that of an earlier fit.

        Unlike the camera's, it hardly changes when fixes show a lever arm that was not known.
        """
        before, now = (
            one.to_world(path).points(path.poses[-1:, :3, 3])[0] + one._arm_at_end(path)[0]
            for one in (last, self)
        )
        return np.asarray(now - before)

    def _arm_at_end(self, path: VideoPath) -> tuple[FloatArray, FloatArray]:
        """Return the lever arm (3,) at the end of a path in the world, and the camera's axes (3, 3) there."""
        axes = self.state.world_R_map[-1] @ path.poses[-1, :3, :3]
        return axes @ self.state.values[-1, ANTENNA], axes

    @cached_property
    def _covariances(self) -> FloatArray:
        return with_time_offset_sigma(self.system.covariances(), TIME_OFFSET, self.time_offset.sigma_s)

    def covariances_at(self, t_s: FloatArray) -> FloatArray:
        """Return covariances (n, 7, 7) of position, log scale and rotation at times (n,), by all fixes."""
        node = np.argmin(np.abs(self.nodes.t_s - t_s[:, None]), axis=1)
        return np.asarray(self._covariances[node, : OFFSET.start, : OFFSET.start])

    def scales_at(self, t_s: FloatArray) -> FloatArray:
        """Return the scale (n,) of the map at times (n,)."""
        return np.asarray(np.exp(np.interp(t_s, self.nodes.t_s, self.state.values[:, SCALE])))

    def covariance_at_end(self, path: VideoPath, config: Config) -> FloatArray:
        """Return the covariance (7, 7) of position, log scale and rotation at the end of a path."""
        return self._covariance_at_end(path, config)[: OFFSET.start, : OFFSET.start]

    def antenna_covariance_at_end(self, path: VideoPath, config: Config) -> FloatArray:
        """Return the covariance (3, 3) of the antenna's position at the end of a path."""
        arm, axes = self._arm_at_end(path)
        J = np.zeros((3, UNKNOWNS))
        J[:, POSITION], J[:, ROTATION], J[:, ANTENNA] = np.eye(3), -cross_matrices(arm), axes
        return np.asarray(J @ self._covariance_at_end(path, config) @ J.T)

    def _covariance_at_end(self, path: VideoPath, config: Config) -> FloatArray:
        """Return the covariance (16, 16) of all unknowns of a node at the end of a path."""
        ends = np.concatenate([path.at(self.nodes.t_s[-1:]), path.poses[-1:]])
        frames = float(path.moving[path.t_s > self.newest_s + SAME_TIME_S].sum())
        if frames == 0.0:
            return self.covariance
        bent = np.diff(path.bent(np.array([self.nodes.t_s[-1], path.t_s[-1]])))
        drift = video_drift(ends, np.array([frames]), bent, config)
        x, R = self.state.values[-1], self.state.world_R_map[-1]
        step = np.exp(x[SCALE]) * R @ (ends[1, :3, 3] - ends[0, :3, 3])
        F = np.eye(UNKNOWNS)
        F[POSITION, SCALE], F[POSITION, ROTATION] = step, -cross_matrices(step)
        noise = np.zeros_like(F)
        noise[POSITION, POSITION] = np.linalg.inv(drift.step_information(step[None])[0])
        noise[SCALE, SCALE] = drift.scale[0] ** 2
        noise[ROTATION, ROTATION] = drift.rotation[0] ** 2 * np.eye(3)
        return np.asarray(F @ self.covariance @ F.T + noise)


def fuse(
    path: VideoPath,
    fixes: Fixes,
    lever_arm: LeverArm,
    config: Config,
    last: FusedPath | None,
    gravity: Gravity | None = None,
) -> FusedPath:
    """Return the fit of a path to its fixes.

    Args:
        path: At least two frames of a map that was aligned with the world once.
        fixes: Fixes that take part, the time offset known before the map removed.
        lever_arm: What is known of it without these fixes; an earlier fit knows more.
        config: Errors of fixes, drift, and the prior of a level camera.
        last: The fit of an earlier part of the same path.
        gravity: The vertical by an IMU, if there is one.
    """
    prior, rest = None, unseen_time_offset(config.sensors)
    if last is not None:
        node = min(int(np.searchsorted(last.nodes.t_s, path.t_s[0] - SAME_TIME_S)), len(last.nodes.t_s) - 1)
        path = path.since(float(last.nodes.t_s[node]))
        prior = (last.carried if node == last.last_fix else None) or _prior_of(last, node)
        rest = last.time_offset
    seen = seen_fixes(path, fixes.where(fixes.used), rest)
    continued = _continued(seen.fixes, last) if last is not None else None
    nodes = fusion_nodes(path, seen, config, continued, last.sizes if last else None)
    if gravity is not None:
        scale = np.ones(len(nodes.t_s)) if last is None else last.scales_at(nodes.t_s)
        nodes = gravity.levelled(nodes, path, scale)
    state = _start(nodes, lever_arm) if last is None else _continue(nodes, last)
    bias_rad = np.array([_ANY_ROLL_RAD, _NO_PITCH_RAD]) if gravity is None else np.full(2, gravity.bias_rad)
    prior = prior or vague_prior(state, bias_rad, lever_arm.covariance)
    state = minimise(nodes, state, prior, config.drift.iterations)
    found = unknown_time_offset(nodes, state, prior, config.sensors)
    return FusedPath(
        nodes=nodes,
        state=state,
        prior=prior,
        time_offset=found.time_offset,
        covariance=found.covariance,
        system=found.system,
    )


def _prior_of(last: FusedPath, node: int) -> FirstNodePrior:
    """Return what the nodes before one say of it."""
    if node == 0:
        return last.prior
    rows = slice(0, node + 1)
    state = FusionState(last.state.values[rows], last.state.world_R_map[rows])
    system = normal_equations(last.nodes.until(node), state, last.prior)
    at = FusionState(state.values[-1:], state.world_R_map[-1:])
    return FirstNodePrior(at, *system.eliminated())


def _continued(fixes: Fixes, last: FusedPath) -> BoolArray:
    """Return whether the first fix (M,) goes on with an offset of the last fit, all others being false."""
    rows = np.zeros(len(fixes), dtype=bool)
    if len(fixes):
        node = np.flatnonzero(np.abs(last.nodes.t_s - fixes.t_s[0]) < SAME_TIME_S)
        rows[0] = len(node) > 0 and not last.nodes.starts[node[0]]
    return rows


def _start(nodes: FusionNodes, lever_arm: LeverArm) -> FusionState:
    """Return the state of a map that is aligned with the world."""
    values = np.zeros((len(nodes.t_s), UNKNOWNS))
    values[:, POSITION], values[:, ANTENNA] = nodes.camera[:, :3, 3], lever_arm.camera_p_antenna
    return FusionState(values, np.tile(np.eye(3), (len(values), 1, 1)))


def _continue(nodes: FusionNodes, last: FusedPath) -> FusionState:
    """Return the last fit at the new nodes; beyond it the path goes on with the video.

    An offset is what its new fixes differ from that, unless these are RTK-fixes: begun as an error of the
    path, a jump of the receiver would first move the path, and may hold it in a minimum there.
    """
    before, t_s = last.nodes.t_s, nodes.t_s
    values = interpolate_vectors(before, last.state.values, t_s)
    node = np.clip(np.searchsorted(before, t_s + SAME_TIME_S) - 1, 0, None)
    R = last.state.world_R_map[node]
    new = int(np.searchsorted(t_s, before[-1] + SAME_TIME_S))
    if 0 < new < len(t_s):
        steps = np.diff(nodes.camera[new - 1 :, :3, 3], axis=0) @ (np.exp(values[-1, SCALE]) * R[-1]).T
        values[new:, POSITION] = values[new - 1, POSITION] + np.cumsum(steps, axis=0)
    values[:, TIME_OFFSET] = nodes.time_offset.time_offset_s
    state = FusionState(values, R)
    for begin, offset in zip(*_new_offsets(nodes, state, last), strict=True):
        values[begin:, OFFSET] = offset
    return state


def _new_offsets(nodes: FusionNodes, state: FusionState, last: FusedPath) -> tuple[IntArray, FloatArray]:
    """Return the nodes (K,) where new offsets begin, or old ones have new fixes, and by how much these fixes
    differ from the path (K, 3)."""
    fixes, known_s = nodes.fixes, last.nodes.t_s[last.nodes.starts]
    node, first = np.unique(fixes.node, return_index=True)
    t_s, starts = nodes.t_s[node], nodes.starts[node]
    arm = (fixes.axes[first] @ state.values[node, ANTENNA, None])[:, :, 0]
    away = np.exp(state.values[node, SCALE])[:, None] * fixes.step[first] + arm
    antenna = state.values[node, POSITION] + (state.world_R_map[node] @ away[:, :, None])[:, :, 0]
    begins = starts & (np.abs(known_s - t_s[:, None]) > SAME_TIME_S).all(axis=1)
    goes_on = ~starts & (t_s > last.nodes.t_s[last.last_fix] + SAME_TIME_S)
    goes_on &= fixes.fix_class[first] != CLASSES.index(FixClass.RTK_FIX)
    rows = begins | goes_on
    return node[rows], fixes.world_p_fix[first][rows] - antenna[rows]
