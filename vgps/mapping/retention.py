"""How far back a sequence that is fed live remembers, and what it gives back when it forgets."""

from dataclasses import dataclass

import numpy as np

from vgps.config import Config
from vgps.mapping.local_map import LocalMap
from vgps.model import FloatArray


@dataclass(frozen=True)
class RetentionPolicy:
    """How far back a sequence remembers: observations and views in frames, path and fixes in seconds.

    Stage C needs the observations of a window and of the longest track before it; more changes nothing. Drift
    and verdicts are found on the path.
    """

    view_frames: int
    path_s: float

    @classmethod
    def of(cls, config: Config) -> "RetentionPolicy":
        """The least that leaves stage C what it needs."""
        window = config.window
        frames = window.length_frames + window.every_frames + config.mapping.max_track_frames
        return cls(frames, config.online.keep_s)


@dataclass(frozen=True)
class RetiredPoses:
    """Poses (n, 4, 4) of the frames from ``first_frame`` on, which a sequence will not change any more."""

    first_frame: int
    poses: FloatArray
    aligned: bool
    bridged: frozenset[int]


def whole(local_map: LocalMap) -> RetiredPoses:
    """All poses of a map that ended."""
    return RetiredPoses(
        local_map.first_frame, local_map.poses, local_map.aligned, frozenset(local_map.bridged)
    )


def oldest(local_map: LocalMap, t_s: FloatArray, horizon_s: float, memory: RetentionPolicy) -> RetiredPoses:
    """What a map holds from before a time, which it lets go of; its observations go by their number of
    frames.

    Args:
        local_map: Changed in place.
        t_s: Times of all frames so far.
        horizon_s: The time.
        memory: How many frames of observations stay.
    """
    first, bridged = local_map.first_frame, frozenset(local_map.bridged)
    before_frame = int(np.searchsorted(t_s, horizon_s))
    poses = local_map.forget(before_frame, local_map.next_frame - memory.view_frames)
    return RetiredPoses(first, poses, local_map.aligned, bridged)
