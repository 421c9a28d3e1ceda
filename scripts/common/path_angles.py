"""Angles between a path and the true one: of the vertical, and of directions of motion."""

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.model import FloatArray
from vgps.solution import Solution, Trajectory


def tilt(solution: Solution | Trajectory, true: Trajectory) -> tuple[float, float]:
    """Return the mean tilt and the size of the constant rotation, degrees."""
    rows = np.abs(true.t_s[:, None] - solution.t_s).argmin(axis=0)
    exact = Rotation.from_matrix(true.world_T_camera[rows, :3, :3])
    found = Rotation.from_matrix(solution.world_T_camera[:, :3, :3])
    constant = (exact.inv() * found).mean()
    up = (found * constant.inv() * exact.inv()).apply([0.0, 0.0, 1.0])
    angles = np.degrees(np.arccos(np.clip(up[:, 2], -1.0, 1.0)))
    return float(angles.mean()), float(np.degrees(constant.magnitude()))


def motion_deg(found: Trajectory, true: Trajectory) -> float:
    """Return the mean angle between directions of motion over a second in the camera's axes, by distance."""
    step = round(1.0 / float(np.median(np.diff(true.t_s))))
    a, b = (_motions(path.world_T_camera, step) for path in (found, true))
    length = np.linalg.norm(b, axis=1)
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1))
    return float(np.degrees(np.average(angle, weights=length)))


def _motions(world_T_camera: FloatArray, step: int) -> FloatArray:
    moved = world_T_camera[step:, :3, 3] - world_T_camera[:-step, :3, 3]
    axes = world_T_camera[step // 2 :][: len(moved), :3, :3]
    return np.asarray(np.einsum("nji,nj->ni", axes, moved))
