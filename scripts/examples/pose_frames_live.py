"""Feed frames and fixes to the online smoother one by one, and print each pose as it comes."""

import argparse
from pathlib import Path

import numpy as np

import vgps


def main() -> None:
    """Play a recording as if it came live; write the run at the end."""
    parser = argparse.ArgumentParser(prog="python -m scripts.examples.pose_frames_live", description=__doc__)
    parser.add_argument("recording", help="recording folder with a GPS log")
    parser.add_argument("run", type=Path, help="run folder that is written")
    given = parser.parse_args()
    recording = vgps.open_recording(given.recording)
    log = recording.gps
    assert log is not None, "a recording with a GPS log"
    fixes = [
        vgps.Fix(t_s, latitude, longitude, height, fix_class, line=index)
        for index, (t_s, latitude, longitude, height, fix_class) in enumerate(
            zip(log.t_s, log.latitude_deg, log.longitude_deg, log.height_m, log.fix_class, strict=True)
        )
    ]
    smoother = vgps.OnlineSmoother(recording.camera, recording.rig)
    for frame in recording.video.frames():
        while fixes and fixes[0].t_s <= frame.t_s:
            smoother.add_fix(fixes.pop(0))
        estimate = smoother.add_frame(frame.t_s, frame.gray)
        east, north, up = np.round(estimate.global_T_camera[:3, 3], 3)
        print(f"{frame.t_s:8.3f} s  {estimate.state:10}  {east} {north} {up}")
        smoother.refine()  # stage C, now that there is time
    vgps.write_run(smoother.finish(), given.run)


if __name__ == "__main__":
    main()
