"""Is a camera found to hang upside down, or on its side, if nobody says so?

The pictures of recordings with truth are turned by quarters, as those of a camera that was mounted so, which
the calibration and the lever arm follow. Errors are those of all poses, unaligned, offline and live as they
came.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.live_runs import run_live, truth_of
from scripts.common.markdown import LiveTable
from scripts.common.pose_errors import pose_errors
from vgps.model import Camera, FloatArray, Frame, Recording
from vgps.readers.video.derived_video import DerivedVideo

COLUMNS = ["recording", "turned by", "seed", "", "mean [m]", "largest", "rotation [degrees]", "largest"]
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


def main() -> None:
    """Print a markdown table, two rows per recording, turn and seed."""
    parser = ScriptParser("experiments.turned_cameras", __doc__)
    parser.add_argument("recordings", nargs="+", type=Path, help="with truth, of a pinhole camera")
    parser.add_argument("--gps", default="gps_fix.nmea", help="log in the recordings")
    add_seeds(parser, 1)
    given = parser.parse_args()
    table = LiveTable(*COLUMNS)
    with parser.refusals():
        results = parser.results(given)
        for folder in given.recordings:
            upright = vgps.open_recording(folder, gps=given.gps)
            for quarters in range(4):
                recording = turned(upright, quarters)
                true = turned_poses(truth_of(upright).world_T_camera, quarters)
                for seed in range(given.seeds):
                    offline = vgps.smooth(recording, vgps.Config(seed=seed)).world_T_camera
                    live = np.array([one.global_T_camera for one in run_live(recording, seed).estimates])
                    for name, poses in (("offline", offline), ("live", live)):
                        row = pose_errors(poses, true[: len(poses)])
                        results.add(
                            recording=folder.name, turned_deg=90 * quarters, seed=seed, mode=name, **row
                        )
                        numbers = (f"{value:.3f}" for value in row.values())
                        table.add(folder.name, f"{90 * quarters}", f"{seed}", name, *numbers)


if __name__ == "__main__":
    main()
