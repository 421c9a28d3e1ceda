"""The path of a camera by its IMU and fixes, where the video lost its scale.

In fast, blurred turns hardly any parallax exceeds the errors of the observations, and a map built on it has
no scale. What such a map still shows are rotations, which give the gyro's bias, and directions of motion,
which give the heading. Between fixes, gyro and accelerometer carry the path.
"""

from dataclasses import replace

import gtsam
import numpy as np
from gtsam.symbol_shorthand import X
from scipy.spatial.transform import Rotation

from vgps.config import Config
from vgps.geometry import interpolate_vectors
from vgps.gps.antenna_path import antenna_offsets, place
from vgps.gps.fix_factors import gps_graph
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.imu.camera_imu import CameraImu
from vgps.imu.factors import imu_graph
from vgps.imu.rotation import RotationPredictor
from vgps.imu.states import ImuStates, as_bias, bias_key, first_states, velocity_key
from vgps.model import BoolArray, FloatArray
from vgps.solution import Trajectory

_STRAYS, _CLEAR = 0.5, 5.0  # share of a movement, and standard deviations of the fixes
_HEADING_ROUNDS = 5
_MOST_COST = 3.0  # per fix: twice that of three normal errors; where fixes have a wrong clock it is far more
_START_SIGMAS = np.array([0.2, 0.2, 0.2, 1e3, 1e3, 1e3])  # rad, m: what fixes and gravity improve


def contradicted_intervals(path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray) -> BoolArray:
    """Return between which of n fixes and their successors (n - 1,) a path moves differently.

    It does if it differs by more than half of their movement, and by more than five standard deviations.

    Args:
        path: All frames.
        fixes: With the time offset removed; those that are used and within the path count.
        camera_p_antenna: (3,) metres.
    """
    inside = fixes.where(np.flatnonzero(fixes.used & place(path.t_s, fixes.t_s).inside))
    off = np.diff(antenna_offsets(inside, path, camera_p_antenna), axis=0)
    moved = np.diff(inside.world_p_fix, axis=0)
    sigma_m = 0.5 * np.hypot(inside.r_m[1:], inside.r_m[:-1])
    limit = _STRAYS * np.linalg.norm(moved, axis=1) + _CLEAR * sigma_m
    return np.asarray(np.linalg.norm(off, axis=1) > limit)


def inertial_path(
    path: Trajectory, imu: CameraImu, fixes: Fixes, antenna: FloatArray, config: Config
) -> Trajectory | None:
    """Return the poses of the same frames by IMU and fixes; None if these do not give them, or contradict
    each other.

    Args:
        path: All frames; only its rotations from frame to frame and its directions of motion count.
        imu: The samples.
        fixes: With the time offset removed.
        antenna: (3,) camera_p_antenna, metres.
        config: Errors of IMU and fixes.
    """
    covered = np.flatnonzero((path.t_s >= imu.t_s[0]) & (path.t_s <= imu.t_s[-1]))
    if len(covered) < 2:
        return None
    old = path.world_T_camera
    found = _covered_path(Trajectory(path.t_s[covered], old[covered]), imu, fixes, antenna, config)
    if found is None:
        return None
    # the others keep their rotations from frame to frame, at the velocity of the nearest that is covered
    edge = np.clip(np.arange(len(path)), covered[0], covered[-1]) - covered[0]
    velocity = np.gradient(found[:, :3, 3], path.t_s[covered], axis=0)
    poses, away_s = found[edge], path.t_s - path.t_s[covered[edge]]
    poses[:, :3, :3] = poses[:, :3, :3] @ old[covered[edge], :3, :3].transpose(0, 2, 1) @ old[:, :3, :3]
    poses[:, :3, 3] += velocity[edge] * away_s[:, None]
    return Trajectory(path.t_s, poses)


def _covered_path(
    path: Trajectory, imu: CameraImu, fixes: Fixes, antenna: FloatArray, config: Config
) -> FloatArray | None:
    """Return the poses (F, 4, 4) of frames that the IMU covers."""
    t_s = path.t_s
    inside = fixes.where(np.flatnonzero(fixes.used & place(t_s, fixes.t_s).inside))
    gyro = RotationPredictor(imu, config.imu)
    bias = gyro.bias(path)
    if bias is None or len(inside) < config.start.min_fixes or not imu.covers(t_s[:1], t_s[-1:])[0]:
        return None
    imu = replace(imu, bias=np.append(imu.bias[:3], bias.rate_rad_s))
    turns = gyro.integral.relative_rotations(t_s[:-1], t_s[1:], bias.rate_rad_s)
    first_R_camera = _chained(turns)
    by_fixes = interpolate_vectors(inside.t_s, inside.world_p_fix, t_s)
    poses = path.world_T_camera.copy()
    poses[:, :3, :3] = _world_R_first(path, first_R_camera, by_fixes, imu) @ first_R_camera
    poses[:, :3, 3] = by_fixes - poses[:, :3, :3] @ antenna
    start = Trajectory(t_s, poses)
    gps = gps_graph(inside, t_s, Sensors.fixed(antenna), config.with_gps("cauchy").gps)
    beside = place(t_s, inside.t_s).frame
    few, every = np.zeros(len(t_s), dtype=bool), np.ones(len(t_s), dtype=bool)
    few[[0, *beside, *(beside + 1)]] = True
    for knots in (few, every):  # few show sooner whether IMU and fixes contradict each other
        states = first_states(start, knots, imu, config.imu)
        if states is None:
            return None
        found, cost = _optimised(start, imu, states, gps, config)
        if cost >= _MOST_COST * len(inside):
            return None
    return found


def _chained(turns: FloatArray) -> FloatArray:
    """Return rotations (F, 3, 3) to the first frame's axes from those between frames (F - 1, 3, 3)."""
    chained = [np.eye(3)]
    for turn in turns:
        chained.append(chained[-1] @ turn)
    return np.array(chained)


def _world_R_first(
    path: Trajectory, first_R_camera: FloatArray, by_fixes: FloatArray, imu: CameraImu
) -> FloatArray:
    """Return the rotation (3, 3) that makes gravity vertical and lays the directions of motion on the fixes'.

    Args:
        path: Its steps count in the camera's axes, without their length.
        first_R_camera: (F, 3, 3) by the gyro.
        by_fixes: (F, 3) positions.
        imu: Its mean specific force points up.
    """
    force = interpolate_vectors(imu.t_s, imu.force_m_s2 - imu.bias[:3], path.t_s)
    up = np.einsum("fij,fj->i", first_R_camera, force)
    level, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])
    world_T_camera = path.world_T_camera
    step = np.einsum("fji,fj->fi", world_T_camera[:-1, :3, :3], np.diff(world_T_camera[:, :3, 3], axis=0))
    step = level.apply(np.einsum("fij,fj->fi", first_R_camera[:-1], step))
    seen, moved = (v[:, 0] + 1j * v[:, 1] for v in (step, np.diff(by_fixes, axis=0)))
    length = np.maximum(np.linalg.norm(step, axis=1), np.finfo(float).tiny)
    turn = moved * np.conj(seen) / length  # a step along the vertical hardly counts
    turn = turn[np.isfinite(turn)]
    weight = np.ones(len(turn))
    for _ in range(_HEADING_ROUNDS):
        heading = float(np.angle(np.sum(weight * turn)))
        weight = 1.0 / (1.0 + np.angle(turn * np.exp(-1j * heading)) ** 2)
    return np.asarray((Rotation.from_euler("z", heading) * level).as_matrix())


def _optimised(
    start: Trajectory,
    imu: CameraImu,
    states: ImuStates,
    gps: gtsam.NonlinearFactorGraph,
    config: Config,
) -> tuple[FloatArray, float]:
    """Return the poses (K, 4, 4) of the knots that minimise the errors of IMU and fixes, and their cost."""
    graph, values = imu_graph(imu, states, start.t_s, config.imu), gtsam.Values()
    graph.push_back(gps)
    frames = states.frame.tolist()
    for k, frame in enumerate(frames):
        values.insert(X(frame), gtsam.Pose3(start.world_T_camera[frame]))
        values.insert(velocity_key(k), states.velocity[k])
        values.insert(bias_key(k), as_bias(states.bias[k]))
    first = gtsam.noiseModel.Diagonal.Sigmas(_START_SIGMAS)
    graph.addPriorPose3(X(0), gtsam.Pose3(start.world_T_camera[0]), first)
    result = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    return np.array([result.atPose3(X(frame)).matrix() for frame in frames]), float(graph.error(result))
