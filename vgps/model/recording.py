"""A recording: what a run starts from."""

from dataclasses import dataclass
from pathlib import Path

from vgps.model.camera import Camera, CameraGuess
from vgps.model.control_points import ControlPoints
from vgps.model.gps import GpsLog
from vgps.model.inertial import GyroLog, ImuLog
from vgps.model.rig import Rig, RigCamera
from vgps.model.video import Masks, Video


@dataclass(frozen=True, kw_only=True)
class Recording:
    """A recording: video, calibration and sensor logs, all on the video's clock.

    ``cameras`` are those of the rig beside ``camera``, the reference. ``notes`` says what was left out, and
    why. Without a calibration ``guesses`` says what the camera may be, and ``camera`` is the first of them.
    """

    path: Path
    video: Video
    camera: Camera
    rig: Rig
    gps: GpsLog | None = None
    gyro: GyroLog | None = None
    imu: ImuLog | None = None
    control_points: ControlPoints | None = None
    masks: Masks | None = None
    notes: tuple[str, ...] = ()
    guesses: tuple[CameraGuess, ...] = ()
    cameras: tuple[RigCamera, ...] = ()
