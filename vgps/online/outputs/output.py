"""Where estimates go, and estimates as JSON lines: one object per line, ``type`` pose or event.

Unknown numbers are null. Every line has a ``schema_version``, so that a reader may start at any line.
"""

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from types import MappingProxyType
from typing import Any, TextIO

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.geodesy import heading_deg, to_geodetic
from vgps.model import FloatArray, GeodeticPoint, GrayImage
from vgps.online.estimate import OnlineEstimate, OnlineEvent

SCHEMA_VERSION = 1  # of the lines
_AXES = "east", "north", "up"


class PoseOutput(ABC):
    """A receiver of estimates.

    Attributes:
        start_utc: UTC instant of the first frame, once it is known.
    """

    start_utc: datetime | None = None

    @abstractmethod
    def write(self, estimate: OnlineEstimate, latency_s: float) -> None:
        """Write the events and the pose of a frame.

        Args:
            estimate: The estimate.
            latency_s: Time since the frame's arrival.
        """

    def show(self, t_s: float, gray: GrayImage) -> None:  # noqa: B027  (most outputs show no pictures)
        """Show the luminance (H, W) of a frame, after its pose."""

    def close(self) -> None:  # noqa: B027  (a stream stays open)
        """Close what the output has opened."""


class Outputs(PoseOutput):
    """Several outputs as one."""

    def __init__(self, outputs: Sequence[PoseOutput], start_utc: datetime | None) -> None:
        self._outputs, self.start_utc = outputs, start_utc

    def write(self, estimate: OnlineEstimate, latency_s: float) -> None:
        """Write to all of them."""
        for output in self._outputs:
            output.start_utc = self.start_utc
            output.write(estimate, latency_s)

    def show(self, t_s: float, gray: GrayImage) -> None:
        """Show a frame in all of them."""
        for output in self._outputs:
            output.show(t_s, gray)


class JsonMessages(PoseOutput):
    """Estimates as JSON objects.

    Args:
        send: Takes the text of each object, without a newline.
    """

    def __init__(self, send: Callable[[str], None]) -> None:
        self._send = send

    def write(self, estimate: OnlineEstimate, latency_s: float) -> None:
        """Send the events and the pose of a frame, an object each."""
        for record in self._records(estimate, latency_s):
            line = {**record, "schema_version": SCHEMA_VERSION}
            self._send(json.dumps(_finite(line), allow_nan=False))

    def _records(self, estimate: OnlineEstimate, latency_s: float) -> Iterator[Mapping[str, Any]]:
        for event in estimate.events:
            yield self._event(event)
        yield {
            "type": "pose",
            "frame": estimate.frame,
            **self._time(estimate.t_s),
            "state": str(estimate.state),
            "global": _pose(estimate.global_T_camera, estimate.world_origin, _sigmas(estimate)),
            "local": _pose(estimate.local_T_camera, estimate.world_origin),
            "latency_s": round(latency_s, 4),
        }

    def _event(self, event: OnlineEvent) -> dict[str, Any]:
        head = {"type": "event", **self._time(event.t_s), "event": event.kind, "text": event.text}
        return {**head, **event.details}

    def _time(self, t_s: float) -> dict[str, Any]:
        if self.start_utc is None:
            return {"t_s": round(t_s, 6)}
        return {"t_s": round(t_s, 6), "utc": (self.start_utc + timedelta(seconds=t_s)).isoformat()}


class JsonLines(JsonMessages):
    """Estimates as JSON lines, flushed one by one for readers of a pipe.

    Args:
        stream: Text stream.
    """

    def __init__(self, stream: TextIO) -> None:
        super().__init__(self._line)
        self._stream = stream

    def _line(self, text: str) -> None:
        self._stream.write(text + "\n")
        self._stream.flush()


def _sigmas(estimate: OnlineEstimate) -> dict[str, float]:
    """Return the standard deviations, named as in a run folder's ``poses.csv``."""
    names = [f"sigma_{axis}_m" for axis in _AXES] + [f"sigma_rot_{axis}_deg" for axis in _AXES]
    numbers = np.append(estimate.sigma_position_m, np.degrees(estimate.sigma_rotation_rad))
    return dict(zip(names, np.round(numbers, 4).tolist(), strict=True))


def _pose(
    world_T_camera: FloatArray, origin: GeodeticPoint | None, more: Mapping[str, float] = MappingProxyType({})
) -> dict[str, float] | None:
    """Return east, north, up, quaternion of world_R_camera, latitude, longitude, height, and heading."""
    if not np.isfinite(world_T_camera[0, 0]):
        return None
    position = world_T_camera[:3, 3]
    quaternion = Rotation.from_matrix(world_T_camera[:3, :3]).as_quat(canonical=True)
    out = dict(zip(("east_m", "north_m", "up_m"), np.round(position, 4).tolist(), strict=True))
    out |= dict(zip(("qx", "qy", "qz", "qw"), np.round(quaternion, 9).tolist(), strict=True))
    if origin is not None:
        latitude, longitude, height = to_geodetic(origin, position).tolist()
        out |= {"latitude_deg": round(latitude, 9), "longitude_deg": round(longitude, 9)}
        out["height_m"] = round(height, 4)
    return {**out, "heading_deg": round(float(heading_deg(world_T_camera)), 4), **more}


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
