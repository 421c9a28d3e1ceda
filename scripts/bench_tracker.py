"""How fast `vgps track` is: frames a second and processor time of the tracker alone, frame by frame.

    python scripts/bench_tracker.py ../shared/data/kitti03_shake --landmarks even.db [--frames 100]

Frames are decoded beforehand. The first frame, which is found by descriptors, is told by itself.
"""

import argparse
import time
from itertools import islice
from pathlib import Path

import numpy as np

from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.localiser import Localiser
from vgps.landmarks.track_settings import TrackConfig
from vgps.readers.recording import open_recording
from vgps.threads import one_blas_thread


def main() -> None:
    """Print a line for each estimator."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path)
    parser.add_argument("--landmarks", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=100)
    given = parser.parse_args()
    recording = open_recording(given.recording, with_gps=False)
    frames = list(islice(recording.video.frames(), given.frames))
    for estimator in ("frame", "graph"):
        config = TrackConfig.model_validate({"estimator": estimator})
        wall, processor, held = [], [], 0
        with LandmarkDatabase.open(given.landmarks, config.selection) as database, one_blas_thread():
            localiser = Localiser(recording, database, config)
            for frame in frames:
                begun, used = time.perf_counter(), time.process_time()
                held += localiser.add(frame.t_s, localiser.undistort(frame.gray)).tracked
                wall.append(1e3 * (time.perf_counter() - begun))
                processor.append(1e3 * (time.process_time() - used))
        later = np.array(wall[1:])
        print(
            f"{estimator}: {held} of {len(frames)} frames, {1e3 / later.mean():.1f} frames/s; ms a frame: "
            f"median {np.median(later):.1f}, 95 % {np.percentile(later, 95):.1f}, "
            f"processor median {np.median(processor[1:]):.1f}; first frame {wall[0]:.0f} ms"
        )


if __name__ == "__main__":
    main()
