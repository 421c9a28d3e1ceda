"""How much of the past the live mode keeps, and the poses that it discards."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray


@dataclass(frozen=True)
class RetentionPolicy:
    """How much is kept: observations in frames that move, path and fixes in seconds.

    Stage C needs the observations of a window and of the longest track before it; keeping more changes
    nothing. Drift correction and outlier detection need the path. During a stop what was seen before it is
    kept as long as the path.
    """

    view_frames: int
    path_s: float

    @classmethod
    def of(cls, config: Config) -> "RetentionPolicy":
        """Return the smallest policy that keeps what stage C needs."""
        window = config.window
        frames = window.length_frames + window.every_frames + config.mapping.max_track_frames
        return cls(frames, config.online.keep_s)


@dataclass(frozen=True)
class RetiredPoses:
    """Final poses (n, 4, 4) of the frames from ``first_frame`` on."""

    first_frame: int
    poses: FloatArray
    aligned: bool
    bridged: frozenset[int]


def retire_map(local_map: LocalMap) -> RetiredPoses:
    """Return all poses of a finished map."""
    return RetiredPoses(local_map.first_frame, local_map.poses, local_map.aligned, local_map.bridged)


def retire_before(local_map: LocalMap, horizon_s: float, policy: RetentionPolicy) -> RetiredPoses:
    """Discard the poses of a map before a time and its older observations, and return the poses.

    Args:
        local_map: Map; changed in place.
        horizon_s: Time of the oldest pose to keep.
        policy: Gives the number of newest frames whose observations are kept.
    """
    first, bridged = local_map.first_frame, local_map.bridged
    oldest = first + int(np.searchsorted(local_map.t_s, horizon_s))
    latest = local_map.next_frame - policy.view_frames  # of frames that all move
    views = max(local_map.last_moving(policy.view_frames), min(oldest, latest))
    poses = local_map.discard_before(oldest, views)
    return RetiredPoses(first, poses, local_map.aligned, bridged)
