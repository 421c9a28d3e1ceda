"""Alignment of a map of unknown scale, heading and position with GPS fixes: the start of Kume 2010."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import StartConfig
from vgps.geometry import cross_matrices
from vgps.mapping.map_update import Similarity
from vgps.model import BoolArray, FloatArray

_UNKNOWNS = 7  # log scale, rotation vector, translation
_ITERATIONS = 100  # upper limit; a dozen suffice
_CONVERGED = 1e-9  # relative decrease of the cost
_MAX_DAMPING = 1e8
_NO_MOTION = 1e-9
_LEAST_ACROSS = 0.3  # of a direction, for it to say what is up beside the path
_CLEAR_GAIN = 3.0  # in the cost; regions are two to three sigmas, so nine or more in log-likelihood
_CLEAR_SHARE = 0.25  # of the cost, where the video has drifted
_RIDGE = 1e-12  # keeps the equations solvable where nothing determines an unknown


@dataclass(frozen=True, kw_only=True)
class Correspondences:
    """Fixes, and the camera in the map at their times.

    Attributes:
        map_T_camera: (M, 4, 4) camera poses.
        world_p_fix: (M, 3) the fixes.
        region_m: (M, 3) size of each fix's region east, north, up.
        camera_p_antenna: (3,) metres.
        map_up: (3,) the normal of the land under a camera that flies; None if it is not known.
    """

    map_T_camera: FloatArray
    world_p_fix: FloatArray
    region_m: FloatArray
    camera_p_antenna: FloatArray
    map_up: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.world_p_fix)

    def where(self, rows: BoolArray) -> "Correspondences":
        """Return some of them."""
        poses, fixes, regions = self.map_T_camera[rows], self.world_p_fix[rows], self.region_m[rows]
        return replace(self, map_T_camera=poses, world_p_fix=fixes, region_m=regions)


@dataclass(frozen=True)
class NormalEquations:
    """Weighted least squares about a similarity, in 7 unknowns about the mean camera position.

    Attributes:
        by_fix: (M, 3, 7) derivatives of the antennas, metres.
        offset: (M, 3) antenna minus fix, metres.
        weight: (M, 3) weights of these, one over square metres.
        by_level: (2, 7) derivatives of the two axes' elevation over their sigmas.
        level: (2,) these elevations.
        level_weight: (2,) their weights.
        cost: The cost, with Cauchy's loss.
    """

    by_fix: FloatArray
    offset: FloatArray
    weight: FloatArray
    by_level: FloatArray
    level: FloatArray
    level_weight: FloatArray
    cost: float

    @property
    def matrix(self) -> FloatArray:
        """The matrix (7, 7)."""
        fixes = np.einsum("mai,ma,maj->ij", self.by_fix, self.weight, self.by_fix)
        return np.asarray(fixes + self.by_level.T @ (self.level_weight[:, None] * self.by_level))

    @property
    def gradient(self) -> FloatArray:
        """The right-hand side (7,)."""
        fixes = np.einsum("mai,ma,ma->i", self.by_fix, self.weight, self.offset)
        return np.asarray(fixes + self.by_level.T @ (self.level_weight * self.level))


def align(seen: Correspondences, config: StartConfig) -> Similarity | None:
    """Return the similarity from map to world that best fits the antenna to the fixes.

    Minimises ``sum rho(||(antenna - fix) / region||)`` over scale, rotation and translation by
    Levenberg-Marquardt. Cauchy's loss rho bounds the effect of outliers, and a prior that the camera is
    upright determines the roll where the fixes are nearly collinear.

    Args:
        seen: Fixes and camera poses.
        config: Constant of the loss, and the prior.

    Returns:
        The similarity, however uncertain; None if the camera was at one place at all fixes.
    """
    starts = _level_starts(seen, config)
    if not starts:
        return None
    start = min(starts, key=lambda start: linearise(seen, start, config).cost)
    if not np.ptp(seen.world_p_fix, axis=0).any():
        return start
    found = _refined(seen, start, config)
    if not config.flies:
        return _turned_as_seen(seen, found, config)
    if _upside_down(seen, found, config):
        return _refined(seen, _turned(seen, found, np.pi), config)
    return found


def _turned_as_seen(seen: Correspondences, found: Similarity, config: StartConfig) -> Similarity:
    """Return a similarity, or one of a turned camera if it explains the fixes far better."""
    cost = linearise(seen, found, config).cost
    if cost < _CLEAR_GAIN:
        return found
    turned = [_refined(seen, _turned(seen, found, 0.5 * np.pi * quarters), config) for quarters in (1, 2, 3)]
    least = min(turned, key=lambda one: linearise(seen, one, config).cost)
    return least if is_far_less(linearise(seen, least, config).cost, cost) else found


def is_far_less(cost: float, other: float) -> bool:
    """Return whether an alignment explains the fixes far better than another, by their costs."""
    return other - cost > max(_CLEAR_GAIN, _CLEAR_SHARE * other)


def _refined(seen: Correspondences, found: Similarity, config: StartConfig) -> Similarity:
    """Return the similarity of least cost near one, by Levenberg-Marquardt."""
    system, damping = linearise(seen, found, config), 1e-4
    for _ in range(_ITERATIONS):
        matrix = system.matrix
        matrix += np.diag(damping * np.diagonal(matrix) + _RIDGE)
        step = -np.linalg.solve(matrix, system.gradient).astype(np.float64)
        trial = _moved(seen, found, step)
        after = linearise(seen, trial, config)
        if after.cost < system.cost:
            converged = system.cost - after.cost < _CONVERGED * system.cost
            found, system, damping = trial, after, damping / 10.0
            if converged:
                break
        elif damping > _MAX_DAMPING:
            break
        else:
            damping *= 10.0
    return found


def _upside_down(seen: Correspondences, at: Similarity, config: StartConfig) -> bool:
    """Return whether the land hangs above the camera, or without land a camera that looks ahead or down."""
    up = -_upright_axes(seen, config)[:, 1:].sum(axis=1) if seen.map_up is None else seen.map_up
    return bool(at.world_R_map[2] @ up < 0.0)


def _turned(seen: Correspondences, at: Similarity, angle_rad: float) -> Similarity:
    """Return a similarity turned about the path: fixes on a line do not see it, nor half a turn the prior."""
    path = (seen.map_T_camera[:, :3, 3] - seen.map_T_camera[:, :3, 3].mean(axis=0)) @ at.world_R_map.T
    main = np.linalg.svd(path, full_matrices=False)[2][0]
    return _moved(seen, at, np.concatenate([[0.0], angle_rad * main, np.zeros(3)]))


def linearise(seen: Correspondences, at: Similarity, config: StartConfig) -> NormalEquations:
    """Return the reweighted normal equations about a similarity."""
    R = at.scale * at.world_R_map
    path = (seen.map_T_camera[:, :3, 3] - seen.map_T_camera[:, :3, 3].mean(axis=0)) @ R.T
    arm = at.world_R_map @ seen.map_T_camera[:, :3, :3] @ seen.camera_p_antenna
    offset = seen.map_T_camera[:, :3, 3] @ R.T + at.world_p_map + arm - seen.world_p_fix
    by_fix = np.zeros((len(seen), 3, _UNKNOWNS))
    by_fix[:, :, 0], by_fix[:, :, 1:4], by_fix[:, :, 4:] = path, -cross_matrices(path + arm), np.eye(3)

    axes, sigma_deg = _level_axes(seen, config)
    axes, sigma = at.world_R_map @ axes, np.sin(np.radians(sigma_deg))
    by_level = np.zeros((2, _UNKNOWNS))
    by_level[:, 1:4] = -cross_matrices(axes.T)[:, 2] / sigma[:, None]
    level = axes[2] / sigma

    width = config.robust_regions**2
    squared = np.sum((offset / seen.region_m) ** 2, axis=1)
    return NormalEquations(
        by_fix=by_fix,
        offset=offset,
        weight=1.0 / (1.0 + squared / width)[:, None] / seen.region_m**2,
        by_level=by_level,
        level=level,
        level_weight=1.0 / (1.0 + level**2 / width),
        cost=width * float(np.log1p(squared / width).sum() + np.log1p(level**2 / width).sum()),
    )


def covariance(system: NormalEquations, errors: FloatArray) -> FloatArray:
    """Return the covariance (7, 7) of an alignment: log scale, rotation about the world's axes, position.

    It is ``N^-1 (J^T W V W J + L^T L) N^-1`` for fixes with errors of covariance V, which may be correlated
    and need not be those that the weights W stand for; the level prior L errs by its own sigma.

    Args:
        system: At the alignment.
        errors: (3, M, M) covariances of the fixes along east, north, up.
    """
    by_error = system.by_fix * system.weight[:, :, None]
    spread = np.einsum("mai,amn,naj->ij", by_error, errors, by_error, optimize=True)
    level = system.by_level.T @ (system.level_weight[:, None] * system.by_level)
    ridge = _RIDGE * np.eye(_UNKNOWNS)
    inverse = np.linalg.inv(system.matrix + ridge)
    return np.asarray(inverse @ (spread + level + ridge) @ inverse)


def _moved(seen: Correspondences, at: Similarity, step: FloatArray) -> Similarity:
    """Return a similarity moved by a step (7,) about the mean camera position."""
    scale = float(np.exp(np.clip(step[0], -2.0, 2.0)))
    rotation = np.asarray(Rotation.from_rotvec(step[1:4]).as_matrix(), np.float64)
    mean = seen.map_T_camera[:, :3, 3].mean(axis=0)
    pivot = at.scale * at.world_R_map @ mean + at.world_p_map
    shift = pivot + scale * rotation @ (at.world_p_map - pivot) + step[4:]
    return Similarity(scale * at.scale, rotation @ at.world_R_map, shift)


def _level_axes(seen: Correspondences, config: StartConfig) -> tuple[FloatArray, tuple[float, float]]:
    """Return the two axes (3, 2) in the map that are level, and the standard deviations of their elevations.

    They point to the camera's right and forward: as it looks, or along the land that it sees.
    """
    axes, sigmas_deg = _upright_axes(seen, config)[:, [0, 2]], config.tilt_sigmas_deg
    if seen.map_up is None:
        return axes, sigmas_deg
    forward = np.cross(seen.map_up, axes[:, 0])
    return np.stack([axes[:, 0], forward], axis=1), (sigmas_deg[0], config.land_sigma_deg)


def _upright_axes(seen: Correspondences, config: StartConfig) -> FloatArray:
    """Return the mean axes (3, 3) right, down and forward in the map of the camera, were it not turned."""
    return np.asarray(seen.map_T_camera[:, :3, :3].mean(axis=0) @ config.upright)


def _level_starts(seen: Correspondences, config: StartConfig) -> list[Similarity]:
    """Return initial similarities: main directions of the paths aligned, the camera level or looking down."""
    centres, fixes = seen.map_T_camera[:, :3, 3], seen.world_p_fix
    third = max(1, len(centres) // 3)
    map_direction = centres[-third:].mean(axis=0) - centres[:third].mean(axis=0)
    world_direction = np.median(fixes[-third:], axis=0) - np.median(fixes[:third], axis=0)
    if np.linalg.norm(map_direction) < _NO_MOTION:
        return []
    if np.linalg.norm(world_direction) < _NO_MOTION:  # of unknown length and heading: within a region, north
        world_direction = np.array([0.0, float(np.median(seen.region_m[:, 0])), 0.0])
    scale = float(np.linalg.norm(world_direction) / np.linalg.norm(map_direction))
    forward = map_direction / np.linalg.norm(map_direction)
    world_forward = world_direction / np.linalg.norm(world_direction)
    world_up = _across(np.array([0.0, 0.0, 1.0]), world_forward)
    if np.linalg.norm(world_up) < _LEAST_ACROSS:  # straight up or down
        world_up = _across(np.array([0.0, 1.0, 0.0]), world_forward)
    # the camera's own up, its back, and up from the land
    axes = _upright_axes(seen, config)
    known = [] if seen.map_up is None else [seen.map_up]
    ups = [_across(up, forward) for up in (*known, -axes[:, 1], -axes[:, 2])]
    least = min(_LEAST_ACROSS, max(float(np.linalg.norm(up)) for up in ups))
    rotations = [
        _axes(world_forward, world_up) @ _axes(forward, up).T for up in ups if np.linalg.norm(up) >= least
    ]
    antennas = scale * centres + seen.map_T_camera[:, :3, :3] @ seen.camera_p_antenna
    return [
        Similarity(scale, rotation, np.median(fixes - antennas @ rotation.T, axis=0))
        for rotation in rotations
    ]


def _across(vector: FloatArray, axis: FloatArray) -> FloatArray:
    return vector - (vector @ axis) * axis


def _axes(forward: FloatArray, up: FloatArray) -> FloatArray:
    up = up / np.linalg.norm(up)
    return np.stack([forward, up, np.cross(forward, up)], axis=1)
