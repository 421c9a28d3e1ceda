"""When and how a map finds its place in the world from the fixes seen so far."""

import numpy as np

from vgps.config import Config, StartConfig
from vgps.interpolation import interpolate_poses
from vgps.local_map import LocalMap
from vgps.model import FloatArray
from vgps.smoothing.alignment import Alignment, align
from vgps.smoothing.fixes import Fixes


def try_alignment(
    local_map: LocalMap, t_s: FloatArray, fixes: Fixes, camera_p_antenna: FloatArray, config: Config
) -> list[str] | None:
    """Move the map into the world once the newest fix makes that possible.

    Args:
        local_map: Moved in place.
        t_s: Times of all frames so far.
        fixes: All fixes; later ones than the map's last frame are not looked at.
        camera_p_antenna: (3,) metres.
        config: Its ``start`` says what it takes.

    Returns:
        Nothing if it stays where it is, else warnings, of which there may be none.
    """
    new = fixes.used & (fixes.t_s > t_s[-2]) & (fixes.t_s <= t_s[-1])
    if not new.any():
        return None
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
