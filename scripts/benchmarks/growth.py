"""How do time and memory of the whole program grow with the length of the video?

A section of a recording is played forwards, backwards, forwards ..., ever longer. Every length runs in a
process of its own; its peak memory is noted before the run (``before``, the decoded section is in it), before
stage D, and at the end. Decoding is not in the times. What is linear grows by the factors of the first row.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import vgps
from scripts.common.command import ScriptParser
from scripts.common.markdown import growth_table
from scripts.common.ping_pong import PingPong
from scripts.common.stopwatch import stopwatch
from vgps.errors import RunFolderError
from vgps.model import Frame
from vgps.runtime.memory import peak_memory_mb
from vgps.runtime.progress import NoProgress

Figures = dict[str, float]  # by name with unit


class PeakBeforeBatch(NoProgress):
    """Progress that notes the peak memory as stage D begins, and reports every thousandth frame."""

    def __init__(self) -> None:
        self.front_mb = 0.0

    def track(self, frames: Iterable[Frame], total: int) -> Iterable[Frame]:
        """As in :class:`vgps.runtime.progress.Progress`."""
        for frame in frames:
            if frame.index % 1000 == 0:
                print(f"frame {frame.index} of {total}, {peak_memory_mb():.0f} MB", file=sys.stderr)
            yield frame

    def stage(self, name: str) -> None:
        """As in :class:`vgps.runtime.progress.Progress`; the last stage announced is D."""
        self.front_mb = peak_memory_mb()


def one_length(given: argparse.Namespace, frames: int) -> Figures:
    """Smooth so many frames in this process; return seconds, memory and counts."""
    source = PingPong(vgps.open_recording(given.recording, gps=given.gps), given.section)
    recording, progress, before_mb = source.recording(frames), PeakBeforeBatch(), peak_memory_mb()
    with stopwatch() as elapsed:
        solution = vgps.smooth(recording, progress=progress)
    seconds = {f"{stage} [s]": s for stage, s in solution.seconds.items() if stage != "decode"}
    return {
        "frames": frames,
        **seconds,
        "wall [s]": elapsed.wall_s,
        "CPU [s]": elapsed.cpu_s,
        "wall per frame [s]": elapsed.wall_s / frames,
        "memory before [MB]": before_mb,
        "memory, stages A to C [MB]": progress.front_mb,
        "memory, all stages [MB]": peak_memory_mb(),
        "landmarks": len(solution.landmarks.sigma_px),
        "observations": len(solution.observations.frame),
        "iterations of D": solution.report.iterations,
    }


def in_its_own_process(given: argparse.Namespace, frames: int) -> Figures:
    """Run :func:`one_length` in a new process.

    Raises:
        RunFolderError: It failed; it has said why.
    """
    words = [sys.executable, "-m", "scripts.benchmarks.growth", str(given.recording), "--gps", given.gps]
    words += ["--section", str(given.section), "--one", str(frames)]
    done = subprocess.run(words, check=False, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        raise RunFolderError(f"the run of {frames} frames ended with exit code {done.returncode}")
    figures: Figures = json.loads(done.stdout.splitlines()[-1])
    return figures


def main() -> None:
    """Print the table, again after every length, for the last may take long."""
    parser = ScriptParser("benchmarks.growth", __doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--gps", default="gps_fix.nmea", help="a path, or a name inside the recording")
    parser.add_argument("--frames", type=int, nargs="+", default=[800, 3200, 12800], help="lengths")
    parser.add_argument("--section", type=int, default=400, help="frames that are played to and fro")
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    with parser.refusals():
        if given.one:
            print(json.dumps(one_length(given, given.one)))
            return
        results, runs = parser.results(given), []
        for frames in given.frames:
            runs.append(in_its_own_process(given, frames))
            results.add(**runs[-1])
            print(growth_table(runs) + "\n", flush=True)


if __name__ == "__main__":
    main()
