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
    """The similarity to the world, and whether the roll had to be taken from a level camera."""

    to_world: Similarity
    straight: bool


def align(
    map_T_camera: FloatArray,
    world_p_fix: FloatArray,
    region_m: FloatArray,
    camera_p_antenna: FloatArray,
    config: StartConfig,
) -> Alignment | None:
    """Return the similarity from map to world that puts the antenna into the fixes' regions, if they suffice.

    Minimises ``sum rho(||(antenna - fix) / region||)`` over scale, rotation and position, with a loss that
    forgives single wrong fixes, and a prior that the camera is upright, which decides the roll where the
    fixes lie too close to a straight line to show it.

    Args:
        map_T_camera: (M, 4, 4) camera poses in the map at the fixes' times.
        world_p_fix: (M, 3) the fixes.
        region_m: (M, 3) size of each fix's region east, north, up.
        camera_p_antenna: (3,) metres.
        config: What it takes to align at all.
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
        scale, rotation, place = _unpack(parameters)
        antenna = scale * map_T_camera[:, :3, 3] @ rotation.T + place
        antenna = antenna + (rotation @ map_T_camera[:, :3, :3]) @ camera_p_antenna
        offset = (antenna - world_p_fix) / region_m
        level = (rotation @ map_T_camera[:, :3, [0, 2]].mean(axis=0))[2] / level_sigma
        return np.append(np.linalg.norm(offset, axis=1), level)

    best = least_squares(
        residual, start, loss="cauchy", f_scale=config.robust_regions, x_scale="jac", max_nfev=200
    )
    scale, rotation, place = _unpack(best.x)
    path = scale * map_T_camera[:, :3, 3]
    straight = _roll_sigma_rad(path - path.mean(axis=0), region_m) > np.radians(config.level_sigma_deg)
    return Alignment(Similarity(scale, rotation, place), straight)


def _roll_sigma_rad(spread: FloatArray, region_m: FloatArray) -> float:
    """Return how well fixes determine the rotation about their own main axis, by their distances from it.

    Regions count as uniform distributions, of sigma r / sqrt(3).
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
    """Return how far the fixes spread, robust to single wrong ones; where the camera stood counts once."""
    places = cell_m * np.unique(np.round(world_p_fix / cell_m), axis=0)
    if len(places) < min_places:  # beside a stop, wrong fixes might be half of them
        places = world_p_fix
    return 2.0 * float(np.median(np.linalg.norm(places - np.median(places, axis=0), axis=1)))


def _level_start(map_T_camera: FloatArray, world_p_fix: FloatArray) -> FloatArray | None:
    """Return the start of the search: main directions of the paths aligned, and the camera level."""
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
    place = np.median(world_p_fix - scale * centres @ rotation.T, axis=0)
    return np.concatenate([[np.log(scale)], Rotation.from_matrix(rotation).as_rotvec(), place])


def _across(vector: FloatArray, axis: FloatArray) -> FloatArray:
    return vector - (vector @ axis) * axis


def _axes(forward: FloatArray, up: FloatArray) -> FloatArray:
    up = up / np.linalg.norm(up)
    return np.stack([forward, up, np.cross(forward, up)], axis=1)
