"""When and how a map finds its place in the world: by the fixes so far, or by control points."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import Config, StartConfig
from vgps.geometry import interpolate_poses
from vgps.gps.fixes import Fixes
from vgps.mapping.local_map import LocalMap
from vgps.mapping.map_update import MapUpdate, Similarity
from vgps.mapping.trajectory import map_trajectory
from vgps.model import FloatArray
from vgps.smoothing.alignment import Alignment, align


@dataclass(frozen=True)
class AlignmentResult:
    """The update that moves a map into the world, and warnings."""

    update: MapUpdate
    warnings: tuple[str, ...] = ()


def align_to_fixes(
    local_map: LocalMap, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> AlignmentResult | None:
    """Move a map into the world if the fixes within its frames make that possible.

    Args:
        local_map: Not aligned yet.
        fixes: All fixes; later ones than the map's last frame are not looked at.
        camera_p_antenna: (3,) metres.
        config: Its ``start`` says what it takes.
    """
    found = find_alignment(local_map, fixes, camera_p_antenna, config.start)
    if found is None:
        return None
    update = MapUpdate(similarity=found.to_world, aligned=True)
    if not found.straight:
        return AlignmentResult(update)
    return AlignmentResult(
        update,
        (
            f"the track up to {local_map.t_s[-1]:.1f} s is too straight to show the camera's roll: it was "
            f"started level, with a standard deviation of {config.start.level_sigma_deg:g} degrees",
        ),
    )


def align_to_control(
    local_map: LocalMap, poses: Mapping[int, FloatArray], min_travel_m: float
) -> AlignmentResult | None:
    """Move a map into the world by frames whose poses control points give, if they suffice.

    Rotation is the mean over these frames, scale the ratio of their spreads.

    Args:
        local_map: Not aligned yet.
        poses: (4, 4) by frame.
        min_travel_m: The frames must lie at least this far apart.
    """
    frames = [f for f in sorted(poses) if local_map.first_posed <= f < local_map.next_frame]
    frames = [f for f in frames if np.isfinite(local_map.pose(f)[0, 0])]
    if len(frames) < 2:
        return None
    world = np.array([poses[f] for f in frames])
    own = np.array([local_map.pose(f) for f in frames])
    spread = [p[:, :3, 3] - p[:, :3, 3].mean(axis=0) for p in (world, own)]
    if np.linalg.norm(np.ptp(world[:, :3, 3], axis=0)) < min_travel_m or np.abs(spread[1]).max() < 1e-9:
        return None
    rotation = Rotation.from_matrix(world[:, :3, :3] @ own[:, :3, :3].transpose(0, 2, 1)).mean().as_matrix()
    scale = float(np.linalg.norm(spread[0]) / np.linalg.norm(spread[1]))
    place = world[:, :3, 3].mean(axis=0) - scale * rotation @ own[:, :3, 3].mean(axis=0)
    return AlignmentResult(MapUpdate(similarity=Similarity(scale, rotation, place), aligned=True))


def find_alignment(
    local_map: LocalMap, fixes: Fixes, camera_p_antenna: FloatArray, config: StartConfig
) -> Alignment | None:
    """Return the similarity that puts a map into the world by the fixes within its frames, if they
    suffice."""
    path = map_trajectory(local_map)
    if len(path) < 2:
        return None
    inside = fixes.where(fixes.used & (fixes.t_s >= path.t_s[0]) & (fixes.t_s <= path.t_s[-1]))
    if len(inside) == 0:
        return None
    posed = np.isfinite(path.world_T_camera[:, 0, 0])
    at_fixes = interpolate_poses(path.t_s[posed], path.world_T_camera[posed], inside.t_s)
    region = np.stack([inside.r_m, inside.r_m, inside.h_m], axis=1)
    return align(at_fixes, inside.world_p_fix, region, camera_p_antenna, config)
