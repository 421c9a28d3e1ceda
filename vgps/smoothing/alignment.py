"""Alignment of a map of unknown scale, heading and position with GPS fixes: the start of Kume 2010."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vgps.config import StartConfig
from vgps.mapping.map_update import Similarity
from vgps.model import FloatArray


@dataclass(frozen=True)
class Alignment:
    """Similarity to the world, and whether the path is too straight to determine the camera's roll."""

    to_world: Similarity
    straight: bool


def align(
    map_T_camera: FloatArray,
    world_p_fix: FloatArray,
    region_m: FloatArray,
    camera_p_antenna: FloatArray,
    config: StartConfig,
) -> Alignment | None:
    """Return the similarity from map to world that best fits the antenna to the fixes.

    Minimises ``sum rho(||(antenna - fix) / region||)`` over scale, rotation and translation. Cauchy's loss
    rho bounds the effect of outliers, and a prior that the camera is upright determines the roll where the
    fixes are nearly collinear.

    Args:
        map_T_camera: (M, 4, 4) camera poses in the map at the fixes' times.
        world_p_fix: (M, 3) the fixes.
        region_m: (M, 3) size of each fix's region east, north, up.
        camera_p_antenna: (3,) metres.
        config: Minimum number and extent of the fixes, and the prior.

    Returns:
        The alignment, or None if the fixes do not suffice.
    """
    if len(world_p_fix) < config.min_fixes:
        return None
    radius = float(np.median(region_m[:, 0]))
    travel = _travel(world_p_fix, max(radius, config.min_travel_m / 4.0), config.min_places)
    if travel < max(config.min_travel_m, config.min_travel_ratio * radius):
        return None
    start = _level_start(map_T_camera, world_p_fix)
    if start is None:
        return None
    level_sigma = np.sin(np.radians([config.level_sigma_deg, config.pitch_sigma_deg]))

    def residual(parameters: FloatArray) -> FloatArray:
        scale, rotation, translation = _unpack(parameters)
        antenna = scale * map_T_camera[:, :3, 3] @ rotation.T + translation
        antenna = antenna + (rotation @ map_T_camera[:, :3, :3]) @ camera_p_antenna
        offset = (antenna - world_p_fix) / region_m
        level = (rotation @ map_T_camera[:, :3, [0, 2]].mean(axis=0))[2] / level_sigma
        return np.append(np.linalg.norm(offset, axis=1), level)

    best = least_squares(
        residual, start, loss="cauchy", f_scale=config.robust_regions, x_scale="jac", max_nfev=200
    )
    scale, rotation, translation = _unpack(best.x)
    path = scale * map_T_camera[:, :3, 3]
    straight = _roll_sigma_rad(path - path.mean(axis=0), region_m) > np.radians(config.level_sigma_deg)
    return Alignment(Similarity(scale, rotation, translation), straight)


def _roll_sigma_rad(spread: FloatArray, region_m: FloatArray) -> float:
    """Return the standard deviation of the rotation about the fixes' main axis, by their distances from it.

    Regions are taken as uniform distributions, of sigma r / sqrt(3).
    """
    axis = _main_axis(spread)
    lever = np.linalg.norm(spread - np.outer(spread @ axis, axis), axis=1)
    sigma = region_m.mean(axis=1) / np.sqrt(3.0)
    information = float(np.sum((lever / sigma) ** 2))
    return float(1.0 / np.sqrt(max(information, 1e-12)))


def _unpack(parameters: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    rotation = Rotation.from_rotvec(parameters[1:4]).as_matrix()
    return (
        float(np.exp(np.clip(parameters[0], -50.0, 50.0))),
        np.asarray(rotation, np.float64),
        parameters[4:7],
    )


def _main_axis(spread: FloatArray) -> FloatArray:
    _, _, right = np.linalg.svd(spread, full_matrices=False)
    return np.asarray(right[0])


def _travel(world_p_fix: FloatArray, cell_m: float, min_places: int) -> float:
    """Return the extent of the fixes, robust to outliers; fixes during a stop count once."""
    cells = cell_m * np.unique(np.round(world_p_fix / cell_m), axis=0)
    if len(cells) < min_places:  # around a stop, outliers might be half of the cells
        cells = world_p_fix
    return 2.0 * float(np.median(np.linalg.norm(cells - np.median(cells, axis=0), axis=1)))


def _level_start(map_T_camera: FloatArray, world_p_fix: FloatArray) -> FloatArray | None:
    """Return initial parameters: main directions of the paths aligned, and the camera level."""
    centres = map_T_camera[:, :3, 3]
    first, last = slice(None, max(1, len(centres) // 3)), slice(-max(1, len(centres) // 3), None)
    map_direction = centres[last].mean(axis=0) - centres[first].mean(axis=0)
    world_direction = np.median(world_p_fix[last], axis=0) - np.median(world_p_fix[first], axis=0)
    if min(np.linalg.norm(map_direction), np.linalg.norm(world_direction)) < 1e-9:
        return None
    scale = float(np.linalg.norm(world_direction) / np.linalg.norm(map_direction))
    forward = map_direction / np.linalg.norm(map_direction)
    world_forward = world_direction / np.linalg.norm(world_direction)
    up = _across(-map_T_camera[:, :3, 1].mean(axis=0), forward)
    if np.linalg.norm(up) < 0.3:  # the camera looks along its own up axis: straight down or up
        up = _across(-map_T_camera[:, :3, 2].mean(axis=0), forward)
    world_up = _across(np.array([0.0, 0.0, 1.0]), world_forward)
    rotation = _axes(world_forward, world_up) @ _axes(forward, up).T
    translation = np.median(world_p_fix - scale * centres @ rotation.T, axis=0)
    return np.concatenate([[np.log(scale)], Rotation.from_matrix(rotation).as_rotvec(), translation])


def _across(vector: FloatArray, axis: FloatArray) -> FloatArray:
    return vector - (vector @ axis) * axis


def _axes(forward: FloatArray, up: FloatArray) -> FloatArray:
    up = up / np.linalg.norm(up)
    return np.stack([forward, up, np.cross(forward, up)], axis=1)
