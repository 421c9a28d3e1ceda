"""How much of the sky the scene hides from the antenna, and how much worse that makes a fix.

Future work of Kume 2010: multipath, estimated from the reconstructed scene. The landmarks around the antenna
give the height of the horizon in every direction, and the satellites behind it count as lost: their signals
arrive weakened, or reflected by a wall.
"""

from dataclasses import replace

import numpy as np

from vgps.config import GpsConfig, QualityConfig, SkyConfig
from vgps.gps.fixes import Fixes, antenna_at, place
from vgps.gps.regions import UNKNOWNS
from vgps.gps.sensors import Sensors
from vgps.model import FloatArray
from vgps.solution import Trajectory


def under_sky(
    fixes: Fixes,
    trajectory: Trajectory,
    world_p_landmark: FloatArray,
    sensors: Sensors,
    satellites: FloatArray,
    config: GpsConfig,
) -> Fixes:
    """Return the fixes with regions enlarged by the hidden share of their sky.

    Args:
        fixes: With the regions of their classes, by their own clock; those outside the video keep theirs.
        trajectory: The camera's path as far as it is known before stage D.
        world_p_landmark: (L, 3) metres.
        sensors: Lever arm and time offset, as far as they are known.
        satellites: (M,) that the receiver says it used, NaN where it does not say.
        config: What counts as hidden, and how many satellites are good; switched off, nothing changes.
    """
    if not config.sky.enlarge:
        return fixes
    placement = place(trajectory.t_s, fixes.t_s - sensors.time_offset_s)
    antenna = antenna_at(trajectory.world_T_camera, placement, sensors.camera_p_antenna)
    share = hidden_share(antenna, world_p_landmark, config.sky)
    factor = np.where(placement.inside, hidden_factor(share, satellites, config.quality), 1.0)
    sizes = {name: factor * getattr(fixes, name) for name in ("r_m", "h_m", "lower_r_m", "lower_h_m")}
    return replace(fixes, **sizes)


def hidden_factor(share: FloatArray, satellites: FloatArray, quality: QualityConfig) -> FloatArray:
    """Return how much larger (M,) a region becomes, at least 1, where a share (M,) of the sky is hidden.

    An error grows with the root of the satellites that are left over to check the others; of those used, or
    as many as are good, the ones in the hidden share are not left.
    """
    used = np.maximum(np.where(np.isfinite(satellites), satellites, quality.good_satellites), UNKNOWNS + 1.0)
    return np.sqrt((used - UNKNOWNS) / np.maximum(used * (1.0 - share) - UNKNOWNS, 1.0))


def hidden_share(world_p_antenna: FloatArray, world_p_landmark: FloatArray, sky: SkyConfig) -> FloatArray:
    """Return the share (M,) of the sky above the elevation mask that lies below the horizon.

    By solid angle: between the elevations e and 90 degrees lies a share 1 - sin(e) of the half sphere.
    """
    low = np.sin(np.radians(sky.mask_deg))
    points = world_p_landmark[np.isfinite(world_p_landmark).all(axis=1)]
    horizons = np.array([horizon_sin(antenna, points, sky) for antenna in world_p_antenna])
    if not len(horizons):
        return np.zeros(0)
    return np.asarray(np.mean(np.maximum(horizons - low, 0.0) / (1.0 - low), axis=1))


def horizon_sin(antenna: FloatArray, points: FloatArray, sky: SkyConfig) -> FloatArray:
    """Return the sine (sectors,) of the horizon's elevation in sectors of azimuth, from east over north; 0 if
    open.

    A sector's horizon is the highest that ``min_landmarks`` of its landmarks reach: single ones may be
    triangulated wrongly. Landmarks further away than ``max_distance_m`` are left out, for the same reason,
    and those nearer than ``min_distance_m``: they may be of the vehicle itself.

    Args:
        antenna: (3,) ENU metres.
        points: (L, 3) landmarks.
        sky: Sectors, limits.
    """
    away = points - antenna
    flat = np.hypot(away[:, 0], away[:, 1])
    rows = np.flatnonzero((away[:, 2] > 0.0) & (flat > sky.min_distance_m) & (flat < sky.max_distance_m))
    height = away[rows, 2] / np.hypot(flat[rows], away[rows, 2])
    azimuth = np.arctan2(away[rows, 1], away[rows, 0]) / (2.0 * np.pi) % 1.0
    sector = np.minimum((azimuth * sky.sectors).astype(np.int64), sky.sectors - 1)
    order = np.lexsort((-height, sector))
    begin = np.searchsorted(sector[order], np.arange(sky.sectors + 1))
    at = begin[:-1] + sky.min_landmarks - 1
    horizon = np.zeros(sky.sectors)
    enough = at < begin[1:]
    horizon[enough] = height[order[at[enough]]]
    return horizon
