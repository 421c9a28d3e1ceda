"""How long does `vgps smooth` take, by stage, and how does that compare with real time?

Every run is a process of its own, timed from outside; seconds by stage are those in its solution.json, where
what ran beside other stages is named so. Medians over the runs.
"""

import json
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from scripts.common.command import ScriptParser
from scripts.common.markdown import table
from scripts.common.stopwatch import stopwatch
from vgps.errors import VgpsError
from vgps.readers.trajectory import read_trajectory


class TimedRun(NamedTuple):
    """Wall seconds of the process and of its stages, frames, and length of the video."""

    wall_s: float
    stages_s: dict[str, float]
    frames: int
    video_s: float


def one_run(recording: str, gps: str | None, out: Path) -> TimedRun:
    """Run `vgps smooth` once.

    Raises:
        VgpsError: It failed.
    """
    words = [sys.executable, "-m", "vgps", "smooth", recording, "--out", str(out)]
    with stopwatch() as elapsed:
        done = subprocess.run(
            [*words, "--gps", gps] if gps else words, check=False, capture_output=True, text=True
        )
    if done.returncode:
        raise VgpsError(done.stderr.strip().splitlines()[-1].removeprefix("vgps: "))
    summary = json.loads((out / "solution.json").read_text(encoding="utf-8"))
    t_s = read_trajectory(out / "poses.tum").t_s
    return TimedRun(elapsed.wall_s, summary["seconds"], len(t_s), float(t_s[-1]))


def main() -> None:
    """Print the medians."""
    parser = ScriptParser("benchmarks.smooth", __doc__)
    parser.add_argument("recording")
    parser.add_argument("--gps", help="a path, or a name inside the recording")
    parser.add_argument("--runs", type=int, default=3, help="number of runs")
    given = parser.parse_args()
    with parser.refusals(), tempfile.TemporaryDirectory() as folder:
        results = parser.results(given)
        runs = [one_run(given.recording, given.gps, Path(folder) / "run") for _ in range(given.runs)]
        for run in runs:
            stages = {f"{stage.replace(' ', '_')}_s": seconds for stage, seconds in run.stages_s.items()}
            results.add(recording=given.recording, gps=given.gps, process_s=run.wall_s, **stages)
    wall_s, first = statistics.median(run.wall_s for run in runs), runs[0]
    rows = [
        (stage, f"{statistics.median(run.stages_s.get(stage, 0.0) for run in runs):.2f}")
        for stage in first.stages_s
    ]
    print(table(["stage", "seconds"], [*rows, ("process", f"{wall_s:.2f}")]))
    speed = {"frames_per_s": first.frames / wall_s, "times_real_time": first.video_s / wall_s}
    print(f"\n{speed['frames_per_s']:.1f} frames/s, {speed['times_real_time']:.2f} x real time")
    results.summarise(frames=first.frames, median_process_s=wall_s, **speed)


if __name__ == "__main__":
    main()
