"""Alignment of a local map with the world by the fixes so far, or by control points."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from vgps.config import Config, StartConfig
from vgps.geometry import interpolate_poses
from vgps.gps.error_covariance import error_covariances
from vgps.gps.fixes import Fixes
from vgps.mapping.bending import continued
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Similarity
from vgps.mapping.trajectory import map_trajectory
from vgps.model import FloatArray
from vgps.smoothing.alignment.alignment_sigmas import (
    AlignmentSigmas,
    alignment_sigmas,
    antenna_covariances,
    bending_covariances,
    jackknife_sigmas,
)
from vgps.smoothing.alignment.land import land_normal
from vgps.smoothing.alignment.pose_similarity import similarity_of_poses
from vgps.smoothing.alignment.similarity import Correspondences, align
from vgps.solution import Trajectory

_JACKKNIFE = _SWING = 4.0  # factors of the limits of standard deviations
_MOST_FIXES = 400  # more of them are thinned out evenly


@dataclass(frozen=True, kw_only=True)
class Alignment:
    """Similarity from a map to the world, and its standard deviations.

    Attributes:
        to_world: The similarity.
        sigmas: Standard deviations by the errors of the fixes.
        determined: Whether these are within the settings' limits, and no part of the path alone decides.
        straight: Whether the path is too straight for the fixes to determine the camera's roll.
        over_land: Whether the land under a camera that flies shows what is level.
        fixes: Number of fixes.
        span_m: Extent of the camera's path between them.
    """

    to_world: Similarity
    sigmas: AlignmentSigmas
    determined: bool
    straight: bool
    over_land: bool
    fixes: int
    span_m: float


@dataclass(frozen=True)
class AlignmentResult:
    """Update that aligns a map with the world, and warnings."""

    update: MapUpdate
    warnings: tuple[str, ...] = ()


def align_to_fixes(
    local_map: LocalMap,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    antenna_sigma_m: float = 0.0,
) -> AlignmentResult | None:
    """Return the alignment of a map with the fixes within its frames, or None if they do not suffice.

    Args:
        local_map: Map that is not aligned.
        fixes: All fixes; those after the map's last frame are ignored.
        camera_p_antenna: (3,) metres.
        config: Gives the requirements, ``start``.
        antenna_sigma_m: Standard deviation of the lever arm.
    """
    alignment = find_alignment(local_map, fixes, camera_p_antenna, config, antenna_sigma_m)
    if alignment is None or not alignment.determined:
        return None
    update = MapUpdate(similarity=alignment.to_world, aligned=True)
    if not alignment.straight:
        return AlignmentResult(update)
    return AlignmentResult(update, (_straight_note(alignment, float(local_map.t_s[-1]), config.start),))


def align_to_control(
    local_map: LocalMap, poses: Mapping[int, FloatArray], min_travel_m: float
) -> AlignmentResult | None:
    """Return the alignment of a map with frames posed by control points, or None if they do not suffice.

    Args:
        local_map: Map that is not aligned.
        poses: World poses (4, 4) by frame.
        min_travel_m: Minimum extent of the frames' positions.
    """
    frames = [f for f in sorted(poses) if local_map.first_posed <= f < local_map.next_frame]
    frames = [f for f in frames if np.isfinite(local_map.pose(f)[0, 0])]
    if len(frames) < 2:
        return None
    world = np.array([poses[f] for f in frames])
    in_map = np.array([local_map.pose(f) for f in frames])
    travel_m, in_map_travel = (np.ptp(path[:, :3, 3], axis=0) for path in (world, in_map))
    if np.linalg.norm(travel_m) < min_travel_m or in_map_travel.max() < 1e-9:
        return None
    return AlignmentResult(MapUpdate(similarity=similarity_of_poses(world, in_map), aligned=True))


def find_alignment(
    local_map: LocalMap,
    fixes: Fixes,
    camera_p_antenna: FloatArray,
    config: Config,
    antenna_sigma_m: float = 0.0,
) -> Alignment | None:
    """Return the alignment of a map with the fixes within its frames, however uncertain; as
    :func:`align_to_fixes`.

    None with fewer than two such fixes, or if the camera was at one place at all of them.
    """
    path = map_trajectory(local_map)
    if len(path) < 2:
        return None
    chosen = fixes_within(path, fixes)
    if len(chosen) < 2:
        return None
    seen = correspondences(path, chosen, camera_p_antenna)
    if config.start.flies:
        seen = replace(seen, map_up=land_normal(local_map.points, seen.map_T_camera[:, :3, 3]))
    to_world = align(seen, config.start)
    if to_world is None:
        return None
    turned = _turned(local_map, path, chosen.t_s, config)
    errors = error_covariances(chosen, config.gps) + bending_covariances(seen, to_world, turned)
    sigmas = alignment_sigmas(seen, to_world, errors, config.start)
    swung = sigmas
    if antenna_sigma_m:
        errors = errors + antenna_covariances(seen, to_world, antenna_sigma_m)
        swung = alignment_sigmas(seen, to_world, errors, config.start)
    determined = len(seen) >= config.start.min_fixes and sigmas.within(config.start)
    return Alignment(
        to_world=to_world,
        sigmas=sigmas,
        # fits mend a scale that an antenna farther out takes as well on an orbit, and no heading far off
        determined=determined
        and swung.heading_rad <= _SWING * np.radians(config.start.heading_sigma_deg)
        and jackknife_sigmas(seen, to_world, config.start).within(config.start, _JACKKNIFE),
        # fixes say less than the prior of a level camera if they leave more than 1 / sqrt(2) of its sigma
        straight=bool(sigmas.tilt_rad > np.radians(config.start.level_sigma_deg) / np.sqrt(2.0)),
        over_land=seen.map_up is not None,
        fixes=len(seen),
        span_m=to_world.scale * float(np.linalg.norm(np.ptp(seen.map_T_camera[:, :3, 3], axis=0))),
    )


def _turned(local_map: LocalMap, path: Trajectory, t_s: FloatArray, config: Config) -> FloatArray:
    """Return the variance (M,), rad^2, by which the path may have turned wrongly from the first fix to each.

    ``t_s`` (M,) are their times; during a stop nothing drifts.
    """
    drift = np.radians(config.drift.rotation_sigma_deg) ** 2 / config.drift.knot_frames
    grows = local_map.moving * np.maximum(continued(local_map.bending), drift)
    turned = np.interp(t_s, path.t_s, np.cumsum(grows[-len(path) :]))
    return np.asarray(turned - turned[0])


def _straight_note(alignment: Alignment, until_s: float, start: StartConfig) -> str:
    """Return what is assumed of the rotation about a straight path."""
    shown, assumed, sigma_deg = "roll", "the camera", start.level_sigma_deg
    if start.flies:
        shown = "roll or pitch"
        assumed = "the land in view" if alignment.over_land else "the camera's pitch"
        sigma_deg = start.land_sigma_deg if alignment.over_land else start.tilt_sigmas_deg[1]
    return (
        f"the path up to {until_s:.1f} s is too straight to determine the camera's {shown}: {assumed} is "
        f"assumed level with a standard deviation of {sigma_deg:g} degrees"
    )


def fixes_within(path: Trajectory, fixes: Fixes) -> Fixes:
    """Return the used fixes within a path; of many some, evenly."""
    inside = np.flatnonzero(fixes.used & (fixes.t_s >= path.t_s[0]) & (fixes.t_s <= path.t_s[-1]))
    if len(inside) > _MOST_FIXES:
        inside = inside[np.linspace(0, len(inside) - 1, _MOST_FIXES).astype(np.int64)]
    return fixes.where(inside)


def correspondences(path: Trajectory, fixes: Fixes, camera_p_antenna: FloatArray) -> Correspondences:
    """Return fixes within a path, and the camera at their times; frames without a pose are passed over."""
    posed = np.isfinite(path.world_T_camera[:, 0, 0])
    return Correspondences(
        map_T_camera=interpolate_poses(path.t_s[posed], path.world_T_camera[posed], fixes.t_s),
        world_p_fix=fixes.world_p_fix,
        region_m=np.stack([fixes.r_m, fixes.r_m, fixes.h_m], axis=1),
        camera_p_antenna=camera_p_antenna,
    )
