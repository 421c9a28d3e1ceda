"""Is stage C's window faster and nearer to the truth than iSAM2 and its fixed-lag smoother?

The features of a real run are replayed to all three. They get the same observations, in the same batches: at
every update those of the last ``--length`` frames of each landmark that has been observed three times in them
on rays at least ``--parallax`` apart (on less iSAM2 finds its system indeterminate), and never again once it
has left that window. They get the same fixes, those that the run used, and the same starts: the true motion
with 0.05 deg and 2 cm of noise per frame, landmarks on the first ray at the run's depth with 3 % of noise.
The first two frames are held at their true poses. The error is that of the newest frames' positions against
the recording's truth, right after each update. What differs is what a method does with older frames: stage C
holds them, iSAM2 keeps estimating them, the fixed-lag smoother marginalises them.
"""

import statistics
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scripts.benchmarks.window.methods import HeldWindow, Incremental, Method
from scripts.benchmarks.window.replay import Batch, Replay, batches
from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from scripts.common.recordings import true_poses
from scripts.common.stopwatch import stopwatch
from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run


@dataclass(frozen=True)
class MethodResult:
    """Seconds and mean position error of the newest frames per update, and why it ended early."""

    seconds: list[float]
    errors_m: list[float]
    failure: str = ""


def run(method: Method, replay: Replay, given: list[Batch]) -> MethodResult:
    """Give a method all batches, and measure."""
    seconds: list[float] = []
    errors_m: list[float] = []
    for batch in given:
        try:
            with stopwatch() as elapsed:
                method.update(batch)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[0][:60]
            return MethodResult(seconds, errors_m, f"failed at frame {batch.last}: {reason}")
        seconds.append(elapsed.wall_s)
        new = range(batch.first, batch.last + 1)
        found = np.array([method.pose(frame).translation() for frame in new])
        errors_m.append(float(np.linalg.norm(found - replay.true[new, :3, 3], axis=1).mean()))
    return MethodResult(seconds, errors_m)


def main() -> None:
    """Print a row for each method."""
    parser = ScriptParser("benchmarks.window", __doc__)
    parser.add_argument("run", type=Path, help="run folder")
    parser.add_argument("--truth", type=Path, help="truth.tum of the run's recording without it")
    parser.add_argument("--frames", type=int, default=300, help="so many of the run's first frames")
    parser.add_argument("--every", type=int, default=15, help="frames per update")
    parser.add_argument("--length", type=int, default=60, help="frames of the window")
    parser.add_argument("--parallax", type=float, default=1.0, help="of a landmark that is used, degrees")
    given = parser.parse_args()
    with parser.refusals():
        results, folder = parser.results(given), read_run(given.run)
        if folder.gps is None:
            raise RunFolderError("has no GPS log", file=given.run, expected="a run with fixes")
        replay = Replay(folder, true_poses(folder, given.run, given.truth)[: given.frames])
    fed = batches(replay, given.every, given.length, float(np.radians(given.parallax)))
    lag_s = float(given.length * np.median(np.diff(replay.t_s)))
    methods: dict[str, Method] = {
        "window, older frames held": HeldWindow(replay, given.length),
        "iSAM2": Incremental(replay, None),
        "iSAM2, fixed lag": Incremental(replay, lag_s),
    }
    observations = sum(len(batch.rows) for batch in fed)
    print(f"{len(replay.true)} frames, {observations} observations\n")
    results.summarise(frames=len(replay.true), observations=observations)
    columns = ("median update [s]", "largest [s]", "last error [m]", "mean error [m]", "")
    table = LiveTable("stage C", *columns)
    for name, method in methods.items():
        result = run(method, replay, fed)
        figures = {}
        if result.seconds:
            figures = {"median_s": statistics.median(result.seconds), "largest_s": max(result.seconds)}
            figures |= {"last_m": result.errors_m[-1], "mean_m": statistics.mean(result.errors_m)}
        results.add(method=name, updates=len(result.seconds), **figures, failure=result.failure)
        cells = [f"{x:.3f}" for x in figures.values()] or [""] * 4
        table.add(name, *cells, result.failure)


if __name__ == "__main__":
    main()
