"""Is a camera found to hang upside down, or on its side, if nobody says so?

The pictures of recordings with truth are turned by quarters, as those of a camera that was mounted so, which
the calibration and the lever arm follow. Errors are those of all poses, unaligned, offline and live as they
came.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from scripts.common.both_ways import Case, print_both_ways
from vgps.model import Camera, FloatArray, Frame, Recording
from vgps.readers.video.derived_video import DerivedVideo

CLOCKWISE = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # camera_R_upright of a quarter


@dataclass(frozen=True)
class TurnedVideo(DerivedVideo):
    """The video of a camera that is turned clockwise by quarters: its pictures turn the other way."""

    quarters: int

    @property
    def width(self) -> int:
        """Width in pixels."""
        return self.video.height if self.quarters % 2 else self.video.width

    @property
    def height(self) -> int:
        """Height in pixels."""
        return self.video.width if self.quarters % 2 else self.video.height

    def frames(self) -> Iterator[Frame]:
        """Yield the turned frames."""
        for frame in self.video.frames():
            yield replace(frame, gray=np.ascontiguousarray(np.rot90(frame.gray, self.quarters)))


def turned(recording: Recording, quarters: int) -> Recording:
    """Return the recording of a pinhole camera as if it had been mounted turned, without gyro and IMU."""
    camera, arm = recording.camera, recording.rig.camera_p_antenna
    for _ in range(quarters):
        camera, arm = _turned_camera(camera), CLOCKWISE @ arm
    return replace(
        recording,
        video=TurnedVideo(recording.video, quarters),
        camera=camera,
        rig=replace(recording.rig, camera_p_antenna=arm),
        gyro=None,
        imu=None,
    )


def turned_poses(world_T_camera: FloatArray, quarters: int) -> FloatArray:
    """Return the poses (F, 4, 4) of a camera that is turned by quarters."""
    poses = world_T_camera.copy()
    poses[:, :3, :3] = poses[:, :3, :3] @ np.linalg.matrix_power(CLOCKWISE, quarters).T
    return poses


def _turned_camera(camera: Camera) -> Camera:
    return replace(
        camera,
        width=camera.height,
        height=camera.width,
        fx=camera.fy,
        fy=camera.fx,
        cx=camera.cy,
        cy=camera.width - 1 - camera.cx,
    )


def cases(upright: Recording, true: FloatArray) -> Iterator[Case]:
    """Yield a recording turned by each number of quarters, in degrees; true poses are (F, 4, 4)."""
    for quarters in range(4):
        frame, poses = np.arange(len(true)), turned_poses(true, quarters)
        yield Case(90 * quarters, turned(upright, quarters), frame, poses)


def main() -> None:
    """Print a markdown table, two rows per recording, change and seed."""
    print_both_ways("experiments.turned_cameras", __doc__, "turned_deg", "gps_fix.nmea", cases)


if __name__ == "__main__":
    main()
