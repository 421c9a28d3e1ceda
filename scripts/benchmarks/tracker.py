"""How fast `vgps track` is: frames a second and processor time of the tracker alone, frame by frame.

Frames are decoded beforehand. The first frame, which is found by descriptors, is told by itself. Then the
processor time of each part in the main thread, a mean over the frames that were followed from the one before.
"""

import argparse
import time
from collections import Counter
from collections.abc import Callable
from functools import wraps
from itertools import islice
from pathlib import Path

import numpy as np

from vgps.config import LocalizationConfig
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization import Localizer, search, tracker
from vgps.localization.graph_estimator import GraphEstimator
from vgps.readers.recording import open_recording
from vgps.runtime.threads import one_blas_thread

PARTS = {
    "finding views": (LandmarkDatabase, "views"),
    "rendering templates": (tracker, "render_templates"),
    "correlation": (search, "match_templates"),
    "poses": (search, "pose_from_matches"),
    "graph": (GraphEstimator, "add"),
    "undistorting": (Localizer, "undistort"),
    "all": (Localizer, "add"),
}


def timed(function: Callable[..., object], name: str, spent: Counter[str]) -> Callable[..., object]:
    """The function, its processor time in milliseconds added up."""

    @wraps(function)
    def call(*given: object, **named: object) -> object:
        begun = time.thread_time()
        try:
            return function(*given, **named)
        finally:
            spent[name] += 1e3 * (time.thread_time() - begun)

    return call


def main() -> None:
    """Print two lines for each estimator."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path)
    parser.add_argument("--landmarks", type=Path, required=True)
    parser.add_argument("--frames", type=int, default=100)
    given = parser.parse_args()
    recording = open_recording(given.recording, with_gps=False)
    frames = list(islice(recording.video.frames(), given.frames))
    spent: Counter[str] = Counter()
    for name, (place, function) in PARTS.items():
        setattr(place, function, timed(getattr(place, function), name, spent))
    for estimator in ("frame", "graph"):
        config = LocalizationConfig.model_validate({"estimator": estimator})
        wall, processor, held, followed = [], [], 0, 0
        parts: Counter[str] = Counter()
        with LandmarkDatabase.open(given.landmarks, config.selection) as database, one_blas_thread():
            localizer = Localizer(recording, database, config)
            for frame in frames:
                begun, used = time.perf_counter(), time.process_time()
                posed = localizer.add(frame.t_s, localizer.undistort(frame.gray))
                wall.append(1e3 * (time.perf_counter() - begun))
                processor.append(1e3 * (time.process_time() - used))
                held += posed.tracked
                parts += Counter() if posed.recovered else spent
                followed += not posed.recovered
                spent.clear()
        later = np.array(wall[1:])
        print(
            f"{estimator}: {held} of {len(frames)} frames, {1e3 / later.mean():.1f} frames/s; ms a frame: "
            f"median {np.median(later):.1f}, 95 % {np.percentile(later, 95):.1f}, "
            f"processor median {np.median(processor[1:]):.1f}; first frame {wall[0]:.0f} ms"
        )
        told = [f"{name} {ms / followed:.1f}" for name, ms in parts.most_common()]
        print(f"  processor, ms a frame: {', '.join(told)}")


if __name__ == "__main__":
    main()
