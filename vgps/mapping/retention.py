"""How much of the past the live mode keeps, and what it hands over when it lets go of it."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray


@dataclass(frozen=True)
class RetentionPolicy:
    """How much is kept: observations and views in frames, path and fixes in seconds.

    Stage C needs the observations of a window and of the longest track before it; more changes nothing. Drift
    and verdicts are found on the path.
    """

    view_frames: int
    path_s: float

    @classmethod
    def of(cls, config: Config) -> "RetentionPolicy":
        """Return the least that leaves stage C what it needs."""
        window = config.window
        frames = window.length_frames + window.every_frames + config.mapping.max_track_frames
        return cls(frames, config.online.keep_s)


@dataclass(frozen=True)
class RetiredPoses:
    """Poses (n, 4, 4) of the frames from ``first_frame`` on, which will not change any more."""

    first_frame: int
    poses: FloatArray
    aligned: bool
    bridged: frozenset[int]


def retire_map(local_map: LocalMap) -> RetiredPoses:
    """Return all poses of a map that ended."""
    return RetiredPoses(local_map.first_frame, local_map.poses, local_map.aligned, local_map.bridged)


def retire_before(local_map: LocalMap, horizon_s: float, policy: RetentionPolicy) -> RetiredPoses:
    """Discard from a map what lies before a time, and observations by their number of frames.

    Args:
        local_map: Changed in place.
        horizon_s: The time.
        policy: How many frames of observations stay.

    Returns:
        The poses that were discarded.
    """
    first, bridged = local_map.first_frame, local_map.bridged
    before = first + int(np.searchsorted(local_map.t_s, horizon_s))
    poses = local_map.discard_before(before, local_map.next_frame - policy.view_frames)
    return RetiredPoses(first, poses, local_map.aligned, bridged)
