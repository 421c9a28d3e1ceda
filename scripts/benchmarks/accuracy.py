"""How accurate is `vgps smooth` on the logs of a recording with truth?

Unaligned errors of the camera centre, fixes rejected, and the time offset found, for each log and seed.
"""

from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_recording_and_logs, add_seeds
from scripts.common.markdown import LiveTable
from vgps.cli.terminal import TerminalProgress
from vgps.evaluation import evaluate
from vgps.solution import Verdict

COLUMNS = ["log", "seed", "frames posed", "mean [m]", "max [m]", "fixes rejected", "time offset [s]"]


def one_run(recording: Path, gps: str, seed: int) -> dict[str, str | int | float]:
    """Return the result of one log and seed.

    Raises:
        VgpsError: The recording cannot be read or smoothed.
    """
    opened = vgps.open_recording(recording, gps=gps)
    solution = vgps.smooth(opened, vgps.Config(seed=seed), TerminalProgress())
    error = evaluate(solution, recording / "truth.tum").camera_position_m
    verdicts = solution.fixes.verdict if solution.fixes else ()
    return {
        "log": Path(gps).stem,
        "seed": seed,
        "frames": int(np.isfinite(solution.world_T_camera[:, 0, 3]).sum()),
        "mean_m": error.mean,
        "max_m": error.max,
        "rejected": verdicts.count(Verdict.REJECTED),
        "time_offset_s": solution.sensors.time_offset_s,
    }


def main() -> None:
    """Print a row per log and seed as it comes."""
    parser = ScriptParser("benchmarks.accuracy", __doc__)
    add_recording_and_logs(parser)
    add_seeds(parser, 1)
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for seed in range(given.seeds):
            for gps in given.logs:
                found = one_run(given.recording, gps, seed)
                results.add(**found)
                table.add(*(f"{x:.3f}" if isinstance(x, float) else str(x) for x in found.values()))


if __name__ == "__main__":
    main()
