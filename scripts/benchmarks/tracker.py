"""How fast is `vgps track`: frames per second, and the processor time of each part?

The tracker alone: frames are decoded beforehand. The first frame, whose pose is found by descriptors, counts
separately. Processor time of the parts is the main thread's, a mean over the frames that were followed from
the one before.
"""

from collections import defaultdict
from collections.abc import Callable
from functools import wraps
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from scripts.common.command import ScriptParser
from scripts.common.markdown import table
from scripts.common.stopwatch import stopwatch
from vgps.config import LocalizationConfig
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization import Localizer, landmark_predictor, search
from vgps.localization.graph_estimator import GraphEstimator
from vgps.model import Frame, Recording
from vgps.readers.recording import open_recording
from vgps.runtime.threads import one_blas_thread

PARTS = {
    "database queries": (LandmarkDatabase, "views"),
    "rendering templates": (landmark_predictor, "render_templates"),
    "correlation": (search, "match_templates"),
    "pose estimation": (search, "pose_from_matches"),
    "graph": (GraphEstimator, "add"),
    "undistortion": (Localizer, "undistort"),
    "all": (Localizer, "add"),
}


def timed(function: Callable[..., object], name: str, spent_ms: dict[str, float]) -> Callable[..., object]:
    """Return the function with its processor time added up in ``spent_ms``."""

    @wraps(function)
    def call(*given: object, **named: object) -> object:
        with stopwatch() as elapsed:
            found = function(*given, **named)
        spent_ms[name] = spent_ms.get(name, 0.0) + 1e3 * elapsed.thread_s
        return found

    return call


def measure(
    recording: Recording, frames: list[Frame], landmarks: Path, estimator: str, spent_ms: dict[str, float]
) -> dict[str, Any]:
    """Track the frames with one of the estimators and return its figures."""
    config = LocalizationConfig.model_validate({"estimator": estimator})
    wall_ms, cpu_ms, held, followed = [], [], 0, 0
    parts_ms: defaultdict[str, float] = defaultdict(float)
    with LandmarkDatabase.open(landmarks, config.selection) as database, one_blas_thread():
        localizer = Localizer(recording, database, config)
        for frame in frames:
            with stopwatch() as elapsed:
                posed = localizer.add(frame.t_s, localizer.undistort(frame.gray))
            wall_ms.append(1e3 * elapsed.wall_s)
            cpu_ms.append(1e3 * elapsed.cpu_s)
            held += posed.tracked
            if not posed.recovered:
                followed += 1
                for name, ms in spent_ms.items():
                    parts_ms[name] += ms
            spent_ms.clear()
    return {
        "estimator": estimator,
        "frames": len(frames),
        "held": held,
        "frames_per_s": 1e3 / np.mean(wall_ms[1:]),
        "median_ms": np.median(wall_ms[1:]),
        "p95_ms": np.percentile(wall_ms[1:], 95),
        "median_cpu_ms": np.median(cpu_ms[1:]),
        "first_frame_ms": wall_ms[0],
        "parts_cpu_ms": {
            name: parts_ms[name] / max(followed, 1) for name in sorted(parts_ms, key=parts_ms.__getitem__)
        },
    }


def main() -> None:
    """Print a row for each estimator, and one for the parts of each."""
    parser = ScriptParser("benchmarks.tracker", __doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--landmarks", type=Path, required=True, help="database of the place")
    parser.add_argument("--frames", type=int, default=100, help="number of frames tracked")
    given = parser.parse_args()
    spent_ms: dict[str, float] = {}
    for name, (place, function) in PARTS.items():
        setattr(place, function, timed(getattr(place, function), name, spent_ms))
    rows = []
    with parser.refusals():
        results = parser.results(given)
        recording = open_recording(given.recording, with_gps=False)
        frames = list(islice(recording.video.frames(), given.frames))
        for estimator in ("frame", "graph"):
            rows.append(measure(recording, frames, given.landmarks, estimator, spent_ms))
            results.add(**rows[-1])
    figures = ["frames_per_s", "median_ms", "p95_ms", "median_cpu_ms", "first_frame_ms"]
    cells = [
        [one["estimator"], f"{one['held']} of {one['frames']}", *(f"{one[name]:.1f}" for name in figures)]
        for one in rows
    ]
    print(table(["estimator", "frames held", *(name.replace("_", " ") for name in figures)], cells))
    for one in rows:
        parts = ", ".join(f"{name} {ms:.1f}" for name, ms in one["parts_cpu_ms"].items())
        print(f"\n{one['estimator']}, processor time by part, ms per frame: {parts}")


if __name__ == "__main__":
    main()
