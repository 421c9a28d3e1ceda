"""Recordings with truth by name: real ones, sections of them, and simulated scenes."""

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import vgps
from scripts.common.recordings import read_truth
from scripts.common.scenes import half_size, shortened
from vgps.errors import RecordingError
from vgps.geodesy import to_enu
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray, Frame, GeodeticPoint, GpsLog, Recording
from vgps.readers.recording import find_gps_logs
from vgps.readers.video.derived_video import DerivedVideo
from vgps.simulate import SCENES, simulate
from vgps.solution import Trajectory

SCENE_S = 30.0  # simulated recordings are this long, in pictures of half the size


@dataclass(frozen=True)
class VideoSection(DerivedVideo):
    """Some of a video's frames as a video of its own: ``first`` to ``last``, both included."""

    first: int
    last: int

    @property
    def times_s(self) -> FloatArray:
        """(F,) seconds since the section's first frame."""
        times = self.video.times_s[self.first : self.last + 1]
        return np.asarray(times - times[0])

    def frames(self) -> Iterator[Frame]:
        """Yield the section's frames; those before it are decoded and dropped."""
        start_s = float(self.video.times_s[self.first])
        for frame in self.video.frames():
            if frame.index > self.last:
                return
            if frame.index >= self.first:
                yield Frame(frame.index - self.first, frame.t_s - start_s, frame.gray)


@dataclass(frozen=True, kw_only=True)
class Drive:
    """A recording without GPS, and its truth.

    Attributes:
        name: As asked for.
        recording: Video, camera and rig.
        origin: Of the world frame.
        truth: On the recording's clock.
        start_s: Time of its first frame on the clock of the shipped logs.
        folder: That of the whole recording.
    """

    name: str
    recording: Recording
    origin: GeodeticPoint
    truth: Trajectory
    start_s: float
    folder: Path

    @property
    def duration_s(self) -> float:
        """Time of the last frame."""
        return float(self.recording.video.times_s[-1])

    def true_antenna(self, t_s: FloatArray) -> FloatArray:
        """Return the true antenna (N, 3) at times (N,), interpolated between frames, ENU metres."""
        poses = interpolate_poses(self.truth.t_s, self.truth.world_T_camera, t_s)
        return np.asarray(poses[:, :3, :3] @ self.recording.rig.camera_p_antenna + poses[:, :3, 3])

    def errors(self, log: GpsLog, late_s: float = 0.0) -> FloatArray:
        """Return errors (N, 3) of a log whose positions are older than their stamps, ENU metres.

        NaN where a position is from before the first frame.
        """
        fixes = to_enu(self.origin, log.latitude_deg, log.longitude_deg, log.height_m)
        error_m = fixes - self.true_antenna(log.t_s - late_s)
        error_m[log.t_s < late_s] = np.nan
        return error_m

    def shipped(self) -> dict[str, Path]:
        """Return the logs beside the recording by name, and those of a folder NAME_more beside that."""
        logs = {file.name: file for file in find_gps_logs(self.folder)}
        more = self.folder.parent / f"{self.folder.name}_more"
        if more.is_dir():
            logs |= {f"{more.name}/{file.name}": file for file in find_gps_logs(more)}
        return logs

    def read_log(self, file: Path) -> GpsLog:
        """Return the fixes of a shipped log within this drive."""
        log = vgps.open_recording(self.folder, gps=file.resolve()).gps
        assert log is not None
        moved = replace(log, t_s=log.t_s - self.start_s)
        return moved.rows((moved.t_s >= 0.0) & (moved.t_s <= self.duration_s))


def open_drive(name: str, data: Path, scenes: Path) -> Drive:
    """Open a recording with truth.

    Args:
        name: A folder, in ``data`` or anywhere, or a scene of the simulator; with ``:FIRST-LAST`` only these
            frames.
        data: Folder of the real recordings.
        scenes: Folder of the simulated ones; one that is missing is made.

    Raises:
        VgpsError: There is no such recording, or it lacks truth, origin or these frames.
    """
    base, section = _parts(name)
    if base in SCENES:
        folder = scenes / base
        if not folder.exists():  # it appears when it is complete
            print(f"simulating {base}", file=sys.stderr)
            simulate(folder, half_size(shortened(SCENES[base], SCENE_S)))
    else:
        folder = data / base
    recording = vgps.open_recording(folder, with_gps=False)
    origin, truth = recording.rig.world_origin, read_truth(folder)
    if origin is None:
        raise RecordingError("no world_origin in rig.yaml", file=folder, expected="the origin of its truth")
    first, last = section or (0, len(recording.video.times_s) - 1)
    if last >= len(recording.video.times_s) or first >= last:
        raise RecordingError(
            f"frames {first} to {last}",
            file=folder,
            expected=f"of frames 0 to {len(recording.video.times_s) - 1}",
        )
    start_s = float(recording.video.times_s[first])
    return Drive(
        name=name,
        recording=replace(
            recording, video=VideoSection(recording.video, first, last), gyro=None, control_points=None
        ),
        origin=origin,
        truth=_cut(truth, start_s, float(recording.video.times_s[last])),
        start_s=start_s,
        folder=folder,
    )


def _parts(name: str) -> tuple[str, tuple[int, int] | None]:
    found = re.fullmatch(r"(.+):(\d+)-(\d+)", name)
    return (found[1], (int(found[2]), int(found[3]))) if found else (name, None)


def _cut(truth: Trajectory, start_s: float, end_s: float) -> Trajectory:
    """Return the truth of a section on its clock."""
    rows = (truth.t_s > start_s - 1e-3) & (truth.t_s < end_s + 1e-3)
    return Trajectory(truth.t_s[rows] - start_s, truth.world_T_camera[rows])
