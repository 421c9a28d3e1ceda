"""The share of the sky that the scene hides from the antenna, and the resulting enlargement of regions.

Future work of Kume 2010: multipath, estimated from the reconstructed scene. The landmarks around the antenna
give the elevation of the horizon in every direction. Satellites below it count as lost: their signals arrive
attenuated, or reflected by a wall.
"""

from dataclasses import replace

import numpy as np

from vgps.config import GpsConfig, QualityConfig, SkyConfig
from vgps.gps.antenna_path import antenna_at, place
from vgps.gps.fixes import Fixes
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
        fixes: At the times of their time stamps, with the regions of their classes; those outside the video
            are not changed.
        trajectory: The camera's path before stage D.
        world_p_landmark: (L, 3) metres.
        sensors: Lever arm and time offset, as estimated so far.
        satellites: (M,) number of satellites that the receiver used; NaN where unknown.
        config: Limits of the horizon, and the number of satellites in a survey; may disable the enlargement.
    """
    if not config.sky.enlarge:
        return fixes
    placement = place(trajectory.t_s, sensors.clock.on_video(fixes.t_s))
    antenna = antenna_at(trajectory.world_T_camera, placement, sensors.camera_p_antenna)
    share = hidden_share(antenna, world_p_landmark, config.sky)
    factor = np.where(placement.inside, hidden_factor(share, satellites, config.quality), 1.0)
    sizes = {name: factor * getattr(fixes, name) for name in ("r_m", "h_m", "lower_r_m", "lower_h_m")}
    return replace(fixes, **sizes)


def hidden_factor(share: FloatArray, satellites: FloatArray, quality: QualityConfig) -> FloatArray:
    """Return the factor (M,), at least 1, by which a region grows where a share (M,) of the sky is hidden.

    The error is proportional to the inverse root of the number of redundant satellites. Of the satellites
    used, or of a survey's number where unknown, those in the hidden share are lost.
    """
    used = np.maximum(np.where(np.isfinite(satellites), satellites, quality.good_satellites), UNKNOWNS + 1.0)
    return np.sqrt((used - UNKNOWNS) / np.maximum(used * (1.0 - share) - UNKNOWNS, 1.0))


def hidden_share(world_p_antenna: FloatArray, world_p_landmark: FloatArray, sky: SkyConfig) -> FloatArray:
    """Return the share (M,) of the sky above the elevation mask that is below the horizon, by solid angle.

    The zone between elevation e and the zenith is a share 1 - sin(e) of the hemisphere.
    """
    low = np.sin(np.radians(sky.mask_deg))
    points = world_p_landmark[np.isfinite(world_p_landmark).all(axis=1)]
    horizons = np.array([horizon_sin(antenna, points, sky) for antenna in world_p_antenna])
    if not len(horizons):
        return np.zeros(0)
    return np.asarray(np.mean(np.maximum(horizons - low, 0.0) / (1.0 - low), axis=1))


def horizon_sin(antenna: FloatArray, points: FloatArray, sky: SkyConfig) -> FloatArray:
    """Return the sine (S,) of the horizon's elevation in sectors of azimuth, from east over north; 0 if open.

    A sector's horizon is the highest elevation that ``min_landmarks`` of its landmarks reach, since single
    ones may be triangulated wrongly. Landmarks farther than ``max_distance_m`` are ignored for the same
    reason, and those nearer than ``min_distance_m`` because they may be on the vehicle.

    Args:
        antenna: (3,) ENU metres.
        points: (L, 3) landmarks.
        sky: Number of sectors, and limits.
    """
    v = points - antenna
    distance = np.hypot(v[:, 0], v[:, 1])
    near, far = sky.min_distance_m, sky.max_distance_m
    rows = np.flatnonzero((v[:, 2] > 0.0) & (distance > near) & (distance < far))
    elevation_sin = v[rows, 2] / np.hypot(distance[rows], v[rows, 2])
    azimuth = np.arctan2(v[rows, 1], v[rows, 0]) / (2.0 * np.pi) % 1.0
    sector = np.minimum((azimuth * sky.sectors).astype(np.int64), sky.sectors - 1)
    order = np.lexsort((-elevation_sin, sector))
    begin = np.searchsorted(sector[order], np.arange(sky.sectors + 1))
    at = begin[:-1] + sky.min_landmarks - 1
    horizon = np.zeros(sky.sectors)
    enough = at < begin[1:]
    horizon[enough] = elevation_sin[order[at[enough]]]
    return horizon
