"""How time and memory of the whole program grow with the video: a recording to and fro, ever longer.

Every length runs in a process of its own, whose peak memory is that of all stages; that before stage D is
told apart. The images of the section are in memory, so decoding is not in the times; ``before`` is what the
process held when it had them, before the run began. What is linear grows as the frames do, in the first row.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import vgps
from scripts.common.ping_pong import PingPong
from vgps.model import Frame
from vgps.runtime.progress import Silent

MEMORY = ("before", "stages A to C", "all stages")


def peak_mb() -> float:
    """The most memory that this process has held, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


class PeakBeforeBatch(Silent):
    """Notes the peak memory as stage D begins, and says now and then how far the run is."""

    def __init__(self) -> None:
        self.front_mb = 0.0

    def track(self, frames: Iterable[Frame], total: int) -> Iterable[Frame]:
        """As in :class:`vgps.runtime.progress.Progress`."""
        for frame in frames:
            if frame.index % 1000 == 0:
                print(f"frame {frame.index} of {total}, {peak_mb():.0f} MB", file=sys.stderr)
            yield frame

    def say(self, what: str) -> None:
        """As in :class:`vgps.runtime.progress.Progress`; the last word before the end is stage D's."""
        self.front_mb = peak_mb()


def one_length(given: argparse.Namespace, frames: int) -> dict[str, dict[str, float]]:
    """StageTimer, memory and counts of one run, in this process."""
    source = PingPong(vgps.open_recording(given.recording, gps=given.gps), given.section)
    recording, progress, before_mb = source.recording(frames), PeakBeforeBatch(), peak_mb()
    wall, cpu = time.perf_counter(), time.process_time()
    solution = vgps.smooth(recording, progress=progress)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    seconds = {k: s for k, s in solution.seconds.items() if k != "decode"}
    memory = dict(zip(MEMORY, (before_mb, progress.front_mb, peak_mb()), strict=True))
    counts = {"landmarks": len(solution.landmarks.sigma_px), "observations": len(solution.observations.frame)}
    counts["iterations of D"] = solution.report.iterations
    return {
        "s": {**seconds, "wall": wall, "CPU": cpu, "wall a frame": wall / frames},
        "MB": memory,
        "count": {k: float(n) for k, n in counts.items()},
    }


def in_its_own_process(given: argparse.Namespace, frames: int) -> dict[str, dict[str, float]]:
    """As :func:`one_length`."""
    words = [sys.executable, "-m", "scripts.benchmarks.growth", str(given.recording), "--gps", given.gps]
    words += ["--section", str(given.section), "--one", str(frames)]
    done = subprocess.run(words, check=True, stdout=subprocess.PIPE, text=True)
    found: dict[str, dict[str, float]] = json.loads(done.stdout.splitlines()[-1])
    return found


def table(frames: list[int], runs: list[dict[str, dict[str, float]]]) -> str:
    """Markdown: a row per figure, a column per length, then how it grew from each length to the next."""
    steps = [f"{a} to {b}" for a, b in pairwise(frames)]
    lines = ["| | " + " | ".join([*(f"{n} frames" for n in frames), *steps]) + " |"]
    lines.append("|---" * (1 + len(frames) + len(steps)) + "|")
    lengths = [float(n) for n in frames]
    rows = {"frames": lengths}
    for unit, figures in runs[0].items():
        for name in figures:
            rows[f"{name} [{unit}]"] = [run[unit].get(name, float("nan")) for run in runs]
    for name, values in rows.items():
        growth = [f"x {b / a:.2f}" if a else "-" for a, b in pairwise(values)]
        lines.append(f"| {name} | " + " | ".join([*(f"{x:.4g}" for x in values), *growth]) + " |")
    return "\n".join(lines)


def main() -> None:
    """Print the table, again after every length, for the last may take long."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--gps", default="gps_fix.nmea")
    parser.add_argument("--frames", type=int, nargs="+", default=[800, 3200, 12800])
    parser.add_argument("--section", type=int, default=400)
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        print(json.dumps(one_length(given, given.one)))
        return
    runs: list[dict[str, dict[str, float]]] = []
    for frames in given.frames:
        runs.append(in_its_own_process(given, frames))
        print(table(given.frames[: len(runs)], runs) + "\n", flush=True)


if __name__ == "__main__":
    main()
