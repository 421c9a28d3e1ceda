"""Write the truth of a recording made from a drive's video, relative to a smoothed run of the drive.

The drive's truth is some tenths of a degree from its own video, and a tracker against landmarks of a run can
only be as right as that run is. The motion from the drive's truth to the recording's, at every time, is put
on the run's poses: that is where the recording's cameras are in the run's world.

    python -m scripts.tools.truth_from_run ../shared/data/kitti03_shake --run run \\
        --run-truth ../shared/data/kitti03/truth.tum --out drive.tum
    vgps evaluate tracked --truth drive.tum
"""

from pathlib import Path

import numpy as np

from scripts.common.command import ScriptParser
from vgps.geometry import interpolate_poses
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Trajectory
from vgps.writers.tum import write_tum


def truth_from_run(made: Trajectory, drive: Trajectory, run: Trajectory) -> Trajectory:
    """Return the poses of a recording made from a drive, ``run_T_drive(t) made(t)``; times are on one clock.

    Args:
        made: Truth of the recording.
        drive: Truth of the drive, in the same world.
        run: Poses of the drive in a smoothed run.
    """
    true, found = (interpolate_poses(one.t_s, one.world_T_camera, made.t_s) for one in (drive, run))
    return Trajectory(made.t_s, found @ np.linalg.inv(true) @ made.world_T_camera)


def main() -> None:
    """Write the truth, on the clock of the recording's video."""
    parser = ScriptParser("tools.truth_from_run", __doc__, measures=False)
    parser.add_argument("recording", type=Path, help="with truth, made from the drive's video")
    parser.add_argument("--run", type=Path, required=True, help="run folder of the drive")
    parser.add_argument("--run-truth", type=Path, required=True, help="truth of the drive's recording")
    parser.add_argument("--out", type=Path, required=True, help="TUM file")
    parser.add_argument("--first", type=int, default=0, help="first frame written")
    parser.add_argument("--every", type=int, default=1, help="then every n-th")
    given = parser.parse_args()
    with parser.refusals():
        start_s = open_recording(given.recording, with_gps=False).rig.video_start_s
        files = given.recording / "truth.tum", given.run_truth, given.run / "poses.tum"
        truth = truth_from_run(*(read_trajectory(file, video_start_s=start_s) for file in files))
        rows = slice(given.first, None, given.every)
        write_tum(Trajectory(truth.t_s[rows], truth.world_T_camera[rows]), given.out)


if __name__ == "__main__":
    main()
