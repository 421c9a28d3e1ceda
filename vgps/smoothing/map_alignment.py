"""When and how a map finds its place in the world from the fixes seen so far."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.config import Config, StartConfig
from vgps.geometry import interpolate_poses
from vgps.gps.fixes import Fixes
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray
from vgps.smoothing.alignment import Alignment, align


def try_alignment(
    local_map: LocalMap, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> list[str] | None:
    """Move the map into the world if the fixes make that possible.

    Args:
        local_map: Moved in place.
        t_s: Times of all frames so far.
        fixes: All fixes; later ones than the map's last frame are not looked at.
        camera_p_antenna: (3,) metres.
        config: Its ``start`` says what it takes.

    Returns:
        Nothing if it stays where it is, else warnings, of which there may be none.
    """
    found = find_alignment(local_map, t_s, fixes, camera_p_antenna, config.start)
    if found is None:
        return None
    local_map.transform(found.scale, found.world_R_map, found.world_p_map)
    local_map.aligned = True
    if not found.straight:
        return []
    return [
        f"the track up to {t_s[-1]:.1f} s is too straight to show the camera's roll: it was started level, "
        f"with a standard deviation of {config.start.level_sigma_deg:g} degrees"
    ]


def align_to_control(local_map: LocalMap, poses: Mapping[int, FloatArray], min_travel_m: float) -> bool:
    """Move the map into the world by frames whose poses control points give; say whether they suffice.

    Rotation is the mean over these frames, scale the ratio of their spreads.

    Args:
        local_map: Moved in place.
        poses: (4, 4) by frame.
        min_travel_m: The frames must lie at least this far apart.
    """
    frames = [f for f in sorted(poses) if local_map.first_posed <= f < local_map.next_frame]
    frames = [f for f in frames if np.isfinite(local_map.pose(f)[0, 0])]
    if len(frames) < 2:
        return False
    world = np.array([poses[f] for f in frames])
    own = np.array([local_map.pose(f) for f in frames])
    spread = [p[:, :3, 3] - p[:, :3, 3].mean(axis=0) for p in (world, own)]
    if np.linalg.norm(np.ptp(world[:, :3, 3], axis=0)) < min_travel_m or np.abs(spread[1]).max() < 1e-9:
        return False
    rotation = Rotation.from_matrix(world[:, :3, :3] @ own[:, :3, :3].transpose(0, 2, 1)).mean().as_matrix()
    scale = float(np.linalg.norm(spread[0]) / np.linalg.norm(spread[1]))
    place = world[:, :3, 3].mean(axis=0) - scale * rotation @ own[:, :3, 3].mean(axis=0)
    local_map.transform(scale, rotation, place)
    local_map.aligned = True
    return True


def find_alignment(
    local_map: LocalMap, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: StartConfig
) -> Alignment | None:
    """The similarity that puts a map into the world by the fixes within its frames, if they suffice."""
    first, last = local_map.first_posed, local_map.next_frame
    times = t_s[first:last]
    if len(times) < 2:
        return None
    inside = fixes.where(fixes.used & (fixes.t_s >= times[0]) & (fixes.t_s <= times[-1]))
    if len(inside) == 0:
        return None
    poses = local_map.poses[first - local_map.first_frame :]
    posed = np.isfinite(poses[:, 0, 0])
    at_fixes = interpolate_poses(times[posed], poses[posed], inside.t_s)
    region = np.stack([inside.r_m, inside.r_m, inside.h_m], axis=1)
    return align(at_fixes, inside.world_p_fix, region, camera_p_antenna, config)
