"""Whether an accelerometer's axes are those of its gyro, and it is where the rig has it; else it is named.

The specific force, turned into the world and integrated twice, has the second differences of the path, with
gravity. So it shows where the axes point: by gravity, by what the path does from moment to moment, and by
how the axes turn. All orders and signs of the three axes are compared, and a sensor that is metres away from
where it should be; the gyro's axes are checked by rotations.
"""

from itertools import permutations, product
from typing import NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from vgps.geometry import cross_matrices, interpolate_poses, interpolate_vectors
from vgps.imu.camera_imu import CameraImu
from vgps.model import FloatArray, ImuMount
from vgps.solution import Trajectory

_INTERVAL_S = 0.3  # an acceleration over it exceeds what errors of positions make of it
_LONGEST_S = 300.0  # of a path that is looked at
_LEAST = 10  # accelerations
_TILT_SIGMA = 0.35  # of the path, rad
_BIAS_SIGMA_M_S2, _SCALE_SIGMA = 0.3, 0.3  # of the accelerometer, of the path
_LEVER_SIGMA_M, _FREE_LEVER_SIGMA_M = 0.1, 5.0  # of the lever arm; of a wrong one
_FIRST_SIGMA_M_S2, _LEAST_SIGMA_M_S2 = 1.0, 0.1  # of an acceleration
_TAIL = 3.0  # degrees of freedom of Student's t
_ITERATIONS = 10
_MAD_SHARE = 0.6745  # median of the absolute value of a standard normal variable
_LIKELIER = 12.0  # in the logarithm, of which log(48) is for having looked at all
_OVERLAP = 0.5  # share of the accelerations that is independent: each shares half its time with the next


class _Moments(NamedTuple):
    """Mean accelerations over n intervals, in the world.

    Attributes:
        path: (n, 3) of the camera.
        axes: (n, 3, 3) of a unit along each of the IMU's axes, as a bias has it.
        lever: (n, 3, 3) of the camera by a metre further along each of the IMU's axes.
        force: (n, 3, 3, 3) of the columns of the log, if column a (last) acted along axis c (last but one).
    """

    path: FloatArray
    axes: FloatArray
    lever: FloatArray
    force: FloatArray


class _Fit(NamedTuple):
    """Cost, size of the residuals [m/s^2] and how far (3,) [m] the camera is from where the rig has it."""

    cost: float
    size: float
    moved: FloatArray


def wrong_forces(path: Trajectory, imu: CameraImu, mount: ImuMount) -> str | None:
    """Return with what instead the specific force would fit a path; None if it fits, or nothing shows.

    Args:
        path: In the world, up to some tens of degrees and of per cent.
        imu: Samples at the camera.
        mount: As the rig states it.
    """
    moments = _moments(path, imu, mount.imu_R_camera)
    if moments is None:
        return None
    sigma, fits = _FIRST_SIGMA_M_S2, []
    for _ in range(2):  # the best residuals of the first time are the errors of the second
        fits = [_fit(moments, axes, imu.gravity_m_s2, sigma, _LEVER_SIGMA_M) for axes in _AXES]
        fits.append(_fit(moments, _AXES[0], imu.gravity_m_s2, sigma, _FREE_LEVER_SIGMA_M))
        sigma = max(min(one.size for one in fits), _LEAST_SIGMA_M_S2)
    costs = [one.cost for one in fits]
    best = int(np.argmin(costs))
    if costs[0] - costs[best] < _LIKELIER:
        return None
    if best < len(_AXES):
        return f"{_in_words(_AXES[best])} in the place of ax, ay, az (the gyro's axes, 9.8 upward at rest)"
    at_m = ", ".join(f"{value:.1f}" for value in mount.imu_p_camera + fits[best].moved)
    return f"an imu_p_camera of about [{at_m}] m"


def _moments(path: Trajectory, imu: CameraImu, imu_R_camera: FloatArray) -> _Moments | None:
    """Return second differences of positions and of the force's second integral, over the same times."""
    inside = (imu.t_s >= path.t_s[0]) & (imu.t_s <= min(path.t_s[-1], path.t_s[0] + _LONGEST_S))
    t_s = imu.t_s[inside]
    seen = path.t_s[(path.t_s >= t_s.min(initial=np.inf)) & (path.t_s <= t_s.max(initial=-np.inf))]
    if len(seen) < _LEAST:
        return None
    rate, force = (
        (samples[inside] - bias) @ imu_R_camera.T
        for samples, bias in ((imu.rate_rad_s, imu.bias[3:]), (imu.force_m_s2, imu.bias[:3]))
    )
    at_s = seen[np.unique(np.searchsorted(seen, np.arange(seen[0], seen[-1], _INTERVAL_S) - 1e-6))]
    shown = imu.covers(at_s[:-2], at_s[2:]) & (at_s[2:] - at_s[:-2] < 4.0 * _INTERVAL_S)
    if shown.sum() < _LEAST:
        return None
    axes = interpolate_poses(path.t_s, path.world_T_camera, t_s)[:, :3, :3] @ imu_R_camera.T
    turning = cross_matrices(rate)
    lever = axes @ (cross_matrices(np.gradient(rate, t_s, axis=0)) + turning @ turning)
    both = [axes, lever, axes[..., None] * force[:, None, None]]
    moved = np.concatenate([one.reshape(len(t_s), -1) for one in both], axis=1)
    for _ in range(2):
        moved = cumulative_trapezoid(moved, t_s, axis=0, initial=0)
    mean = _second_differences(at_s, interpolate_vectors(t_s, moved, at_s))[shown]
    position = interpolate_vectors(path.t_s, path.world_T_camera[:, :3, 3], at_s)
    return _Moments(
        path=_second_differences(at_s, position)[shown],
        axes=mean[:, :9].reshape(-1, 3, 3),
        lever=mean[:, 9:18].reshape(-1, 3, 3),
        force=mean[:, 18:].reshape(-1, 3, 3, 3),
    )


def _second_differences(t_s: FloatArray, x: FloatArray) -> FloatArray:
    """Return mean accelerations (n - 2, k) over two intervals each, weighted towards their middle."""
    velocity = np.diff(x, axis=0) / np.diff(t_s)[:, None]
    return np.asarray(2.0 * np.diff(velocity, axis=0) / (t_s[2:] - t_s[:-2])[:, None])


def _fit(
    moments: _Moments, axes: FloatArray, gravity_m_s2: float, sigma_m_s2: float, lever_sigma_m: float
) -> _Fit:
    """Fit bias, gravity, lever arm and the path's scale under Student's t."""
    n = len(moments.path)
    force = np.einsum("nica,ca->ni", moments.force, axes)
    target = (force - moments.path - [0.0, 0.0, gravity_m_s2]).ravel()
    gravity = np.tile(np.eye(3), (n, 1, 1))
    columns = [moments.axes, gravity, -moments.lever, moments.path[:, :, None]]
    design = np.concatenate(columns, axis=2).reshape(3 * n, -1)
    sigmas = [_BIAS_SIGMA_M_S2, _TILT_SIGMA * gravity_m_s2, lever_sigma_m, _SCALE_SIGMA]
    prior = np.repeat(sigmas, [3, 3, 3, 1]) ** -2.0
    weight, found, residual = np.ones(len(target)), np.zeros(len(prior)), target
    for _ in range(_ITERATIONS):
        weighted = _OVERLAP / sigma_m_s2**2 * weight[:, None] * design
        found = np.linalg.solve(weighted.T @ design + np.diag(prior), weighted.T @ target)
        residual = target - design @ found
        weight = (_TAIL + 1.0) / (_TAIL + (residual / sigma_m_s2) ** 2)
    of_data = _OVERLAP * (_TAIL + 1.0) / 2.0 * np.sum(np.log1p((residual / sigma_m_s2) ** 2 / _TAIL))
    size = float(np.median(np.abs(residual))) / _MAD_SHARE
    return _Fit(float(of_data + 0.5 * prior @ found**2), size, found[6:9])


def _in_words(axes: FloatArray) -> str:
    """Return the columns that act along the IMU's axes, with their signs."""
    columns = [(int(np.argmax(np.abs(row))), row.sum() < 0) for row in axes]
    return ", ".join(f"{'-' if reversed_ else ''}a{'xyz'[column]}" for column, reversed_ in columns)


def _all_axes() -> list[FloatArray]:
    """Return the 48 orders and signs of axes, as they are given first."""
    orders, signs = permutations(range(3)), list(product((1.0, -1.0), repeat=3))
    return [np.eye(3)[list(order)] * np.array(sign)[:, None] for order in orders for sign in signs]


_AXES = _all_axes()
