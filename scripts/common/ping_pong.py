"""A section of a recording played forwards, backwards, forwards ..., as a drive of any length."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np

import vgps
from scripts.common.recordings import read_truth
from vgps.geodesy import to_enu, to_geodetic
from vgps.geometry import interpolate_poses
from vgps.model import FixClass, FloatArray, Frame, GrayImage, Recording
from vgps.online.archive import FixArchive


class PingPong:
    """A section of a recording, played forwards and backwards without end.

    Fixes are the true antenna with the errors that the recording's log has in the section, at 1 Hz.

    Args:
        recording: With a GPS log, a world origin and ``truth.tum``.
        section: So many of its first frames.
    """

    def __init__(self, recording: Recording, section: int) -> None:
        self._recording = recording
        truth = read_truth(recording.path)
        self.images: list[GrayImage] = [frame.gray for frame in islice(recording.video.frames(), section)]
        self.interval_s = float(np.median(np.diff(recording.video.times_s)))
        times = recording.video.times_s[: len(self.images)]
        self._t_s, self._poses = times, interpolate_poses(truth.t_s, truth.world_T_camera, times)
        self._antenna = recording.rig.camera_p_antenna
        origin, log = recording.rig.world_origin, recording.gps
        assert origin is not None and log is not None
        inside = (log.t_s > times[0]) & (log.t_s < times[-1])
        fix = to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m)[inside]
        true = self._antennas(interpolate_poses(times, self._poses, log.t_s[inside]))
        self._error, self._origin = fix - true, origin
        self.fix_error_m = float(np.linalg.norm(self._error, axis=1).mean())
        self._class = [kind for kind, row in zip(log.fix_class, inside, strict=True) if row]

    def _antennas(self, poses: FloatArray) -> FloatArray:
        return np.asarray(poses[:, :3, :3] @ self._antenna + poses[:, :3, 3])

    def _row(self, at: float) -> float:
        """Return the row of the section, which may lie between frames, that is shown at frame ``at``."""
        last = len(self.images) - 1
        return last - abs(at % (2 * last) - last)

    def frame(self, index: int) -> tuple[float, GrayImage, FloatArray]:
        """Return time, image and true pose (4, 4) of a frame."""
        row = round(self._row(index))
        return index * self.interval_s, self.images[row], self._poses[row]

    def fix(self, second: int) -> vgps.Fix:
        """Return the fix of a second, shortly after a frame."""
        t_s = second + 0.3 * self.interval_s
        at = np.array([self._row(t_s / self.interval_s) * self.interval_s])
        antenna = self._antennas(interpolate_poses(self._t_s, self._poses, at))[0]
        row = second % len(self._error)
        kind: FixClass = self._class[row]
        position = to_geodetic(self._origin, antenna + self._error[row])
        latitude_deg, longitude_deg, height_m = (float(x) for x in position)
        return vgps.Fix(t_s, latitude_deg, longitude_deg, height_m, kind, second)

    def recording(self, frames: int) -> Recording:
        """Return so many frames and their fixes as a recording."""
        duration_s = (frames - 1) * self.interval_s
        fixes = FixArchive()
        for second in range(int(duration_s)):
            fixes.append(self.fix(second))
        log = fixes.log(Path("ping_pong"))
        return replace(self._recording, video=_Played(self, frames), gps=log)


@dataclass(frozen=True)
class _Played:
    """Frames of a :class:`PingPong`, as a :class:`vgps.model.Video`."""

    source: PingPong
    count: int

    @property
    def path(self) -> Path:
        return Path("ping_pong")

    @property
    def times_s(self) -> FloatArray:
        return self.source.interval_s * np.arange(self.count, dtype=np.float64)

    @property
    def width(self) -> int:
        return int(self.source.images[0].shape[1])

    @property
    def height(self) -> int:
        return int(self.source.images[0].shape[0])

    def frames(self) -> Iterator[Frame]:
        for index in range(self.count):
            t_s, image, _ = self.source.frame(index)
            yield Frame(index, t_s, image)
