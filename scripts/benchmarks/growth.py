"""How do time and memory of the whole program grow with the length of the video?

A section of a recording is played forwards, backwards, forwards ..., ever longer. Every length runs in a
process of its own; its peak memory is noted before the run (``before``, the decoded section is in it), before
stage D, and at the end. Decoding is not in the times. What is linear grows by the factors of the first row.
"""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path

import vgps
from scripts.common.command import ScriptParser
from scripts.common.lengths import Figures, measure_lengths
from scripts.common.ping_pong import PingPong
from scripts.common.stopwatch import stopwatch
from vgps.model import Frame
from vgps.runtime.memory import peak_memory_mb
from vgps.runtime.progress import NoProgress


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


def main() -> None:
    """Measure every length."""
    parser = ScriptParser("benchmarks.growth", __doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--gps", default="gps_fix.nmea", help="a path, or a name inside the recording")
    parser.add_argument("--frames", type=int, nargs="+", default=[800, 3200, 12800], help="lengths")
    parser.add_argument("--section", type=int, default=400, help="frames that are played to and fro")
    measure_lengths(parser, "frames", one_length)


if __name__ == "__main__":
    main()
