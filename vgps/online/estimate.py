"""Output of the live mode: a pose per frame, and events."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from vgps.model import FloatArray, GeodeticPoint


class OnlineState(StrEnum):
    """How a frame was posed when it came."""

    STARTING = "starting"  # no map yet: the camera has not moved enough
    UNALIGNED = "unaligned"  # tracked, but scale, heading and position are not known yet
    TRACKED = "tracked"
    BRIDGED = "bridged"  # no usable features: by the IMU, or at constant velocity for a moment
    LOST = "lost"


@dataclass(frozen=True)
class OnlineEvent:
    """An event at a time of the video.

    ``kind``: ``aligned`` (scale, heading and position are known), ``corrected`` (fixes moved the pose),
    ``lost``, ``found``, ``place`` (of an earlier visit, seen again), ``fix`` (a verdict, new or changed) or
    ``note``.
    """

    t_s: float
    kind: str
    text: str
    details: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class OnlineEstimate:
    """The pose of the newest frame.

    Attributes:
        frame: Its index.
        t_s: Seconds since the first frame.
        state: How it was posed; both poses are NaN unless ``tracked`` or ``bridged``.
        global_T_camera: (4, 4) world_T_camera, the best estimate; it jumps when fixes correct it.
        local_T_camera: (4, 4) world_T_camera without jumps; it approaches the best estimate at a limited
            speed.
        sigma_position_m: (3,) standard deviations of the best estimate's position, east, north, up, or NaN.
        sigma_rotation_rad: (3,) those of its rotation about east, north, up.
        world_origin: Origin of the ENU world; None before the first usable fix, unless the rig gives it.
        events: Events since the previous frame.
        seconds: Processing time until the pose was known.
    """

    frame: int
    t_s: float
    state: OnlineState
    global_T_camera: FloatArray
    local_T_camera: FloatArray
    sigma_position_m: FloatArray
    sigma_rotation_rad: FloatArray
    world_origin: GeodeticPoint | None
    events: tuple[OnlineEvent, ...]
    seconds: float

    @property
    def posed(self) -> bool:
        """Whether there is a pose in the world."""
        return self.state in {OnlineState.TRACKED, OnlineState.BRIDGED}


def counts_as_news(count: int) -> bool:
    """Whether a count of faults is worth a message: 1, 10, 100, ..."""
    return set(str(count)[1:]) <= {"0"} and str(count)[0] == "1"
