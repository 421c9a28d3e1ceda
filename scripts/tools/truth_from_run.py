"""A truth for a recording made from a drive's video, by where a smoothed run has the drive's cameras.

The drive's truth is some tenths of a degree from its own video; a tracker against landmarks of a run can only
be as right as that run is. What the recording's truth is against the drive's, at every time, is put on the
run's poses: that is where its cameras are in the run's world.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

from vgps.errors import VgpsError
from vgps.geometry import interpolate_poses
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Trajectory
from vgps.writers.tum import write_tum


def by_drive(made: Trajectory, drive: Trajectory, run: Trajectory) -> Trajectory:
    """The poses of a recording made from a drive, ``run_T_drive(t) made(t)``; all times on one clock.

    Args:
        made: Truth of the recording.
        drive: Truth of the drive, in the same world.
        run: What a smoothed run says of the drive.
    """
    true, found = (interpolate_poses(one.t_s, one.world_T_camera, made.t_s) for one in (drive, run))
    return Trajectory(made.t_s, found @ np.linalg.inv(true) @ made.world_T_camera)


def main() -> None:
    """Write the truth, on the clock of the recording's video."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path)
    parser.add_argument("--run", type=Path, required=True, help="run folder of the drive")
    parser.add_argument("--run-truth", type=Path, required=True, help="truth of the drive's recording")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, default=0, help="first frame written,")
    parser.add_argument("--every", type=int, default=1, help="then every so many")
    given = parser.parse_args()
    try:
        write(given)
    except VgpsError as error:
        print(f"truth_by_drive: {error}", file=sys.stderr)
        sys.exit(2)


def write(given: argparse.Namespace) -> None:
    """Read the three trajectories, write the one."""
    start_s = open_recording(given.recording, with_gps=False).rig.video_start_s
    places = given.recording / "truth.tum", given.run_truth, given.run / "poses.tum"
    made = by_drive(*(read_trajectory(place, video_start_s=start_s) for place in places))
    written = slice(given.first, None, given.every)
    write_tum(Trajectory(made.t_s[written], made.world_T_camera[written]), given.out)


if __name__ == "__main__":
    main()
