"""How accurate is `vgps smooth` on the logs of a recording with truth?

Unaligned errors of the camera centre, fixes rejected, and the time offset found, for each log and seed.
--reencode runs all of it with the video encoded again, too: a result that such a disturbance flips is chance.
--late and --faster run all of it with the time stamps of another clock, too: moved, or of another rate, as
those of a video whose frame rate nobody measured.
"""

import tempfile
from dataclasses import replace
from itertools import product
from math import nan
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_recording_and_logs, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.reencoded import reencoded
from vgps.cli.terminal import TerminalProgress
from vgps.evaluation import evaluate
from vgps.model import Recording
from vgps.solution import GpsClock, Verdict

COLUMNS = [
    "video",
    "log",
    "late by [s]",
    "clock rate",
    "seed",
    "frames posed",
    "mean [m]",
    "max [m]",
    "fixes rejected",
    "time offset [s]",
    "rate found",
    "NEES",
]


def one_run(opened: Recording, seed: int) -> dict[str, str | int | float]:
    """Return the result of one log and seed.

    Raises:
        VgpsError: The recording cannot be smoothed.
    """
    solution = vgps.smooth(opened, vgps.Config(seed=seed), TerminalProgress())
    found = evaluate(solution, opened.path / "truth.tum")
    error = found.camera_position_m
    verdicts = solution.fixes.verdict if solution.fixes else ()
    return {
        "seed": seed,
        "frames": int(np.isfinite(solution.world_T_camera[:, 0, 3]).sum()),
        "mean_m": error.mean,
        "max_m": error.max,
        "rejected": verdicts.count(Verdict.REJECTED),
        "time_offset_s": solution.sensors.time_offset_s,
        "rate_found": solution.sensors.clock_rate,
        "nees": nan if found.nees is None else found.nees.mean,
    }


def with_clock(opened: Recording, clock: GpsClock) -> Recording:
    """Return a recording whose fixes have the time stamps of another clock."""
    log = opened.gps
    return opened if log is None else replace(opened, gps=replace(log, t_s=clock.time_stamps(log.t_s)))


def main() -> None:
    """Print a row per video, log and seed as it comes."""
    parser = ScriptParser("benchmarks.accuracy", __doc__)
    add_recording_and_logs(parser)
    add_seeds(parser, 1)
    parser.add_argument(
        "--reencode", type=int, nargs="*", default=[], metavar="CRF", help="qualities of x264, as 20 28 34"
    )
    parser.add_argument(
        "--late", type=float, nargs="*", default=[], metavar="S", help="time offsets, as 0.3 -0.2"
    )
    parser.add_argument(
        "--faster", type=float, nargs="*", default=[], metavar="RATE", help="rates of the clock, as 0.01"
    )
    given = parser.parse_args()
    with parser.refusals(), tempfile.TemporaryDirectory() as scratch:
        results, table = parser.results(given), LiveTable(*COLUMNS)
        clocks = [GpsClock(0.0), *map(GpsClock, given.late), *(GpsClock(0.0, rate) for rate in given.faster)]
        for crf in (None, *given.reencode):
            for gps in given.logs:
                opened = vgps.open_recording(given.recording, gps=gps)
                if crf is not None:
                    opened = reencoded(opened, Path(scratch) / f"{crf}.mp4", crf)
                video = "as it is" if crf is None else f"crf {crf}"
                for clock, seed in product(clocks, range(given.seeds)):
                    late_s, rate = clock
                    names: dict[str, str | float] = {
                        "video": video,
                        "log": Path(gps).stem,
                        "late_s": late_s,
                        "clock_rate": rate,
                    }
                    found = {**names, **one_run(with_clock(opened, clock), seed)}
                    results.add(**found)
                    table.add(*found.values())


if __name__ == "__main__":
    main()
