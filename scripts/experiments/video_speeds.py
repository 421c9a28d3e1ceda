"""Is the speed of a time-lapse or of slow motion found, and how good are its poses?

Frames get the times at which a player would show them. Errors are unaligned, of each frame where it was when
it was taken.
"""

from dataclasses import replace
from itertools import product
from math import nan
from pathlib import Path

import vgps
from scripts.common.command import ScriptParser, add_recording_and_logs
from scripts.common.markdown import LiveTable
from vgps.cli.terminal import TerminalProgress
from vgps.evaluation import evaluate
from vgps.model import Recording
from vgps.readers.video.retimed_video import at_speed

COLUMNS = ["log", "speed", "speed found", "mean [m]", "max [m]", "NEES"]


def one_run(opened: Recording, speed: float) -> dict[str, float]:
    """Return the result of a video that plays so many seconds in one.

    Raises:
        VgpsError: The recording cannot be smoothed.
    """
    played = replace(opened, video=at_speed(opened.video, 1.0 / speed))
    solution = vgps.smooth(played, None, TerminalProgress())
    found = evaluate(replace(solution, t_s=opened.video.times_s), opened.path / "truth.tum")
    return {
        "speed_found": solution.sensors.video_speed,
        "mean_m": found.camera_position_m.mean,
        "max_m": found.camera_position_m.max,
        "nees": nan if found.nees is None else found.nees.mean,
    }


def main() -> None:
    """Print a row per log and speed as it comes."""
    parser = ScriptParser("experiments.video_speeds", __doc__)
    add_recording_and_logs(parser)
    parser.add_argument("--speeds", type=float, nargs="+", default=[0.25, 0.5, 1.0, 2.0, 5.0], metavar="V")
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for gps, speed in product(given.logs, given.speeds):
            found = one_run(vgps.open_recording(given.recording, gps=gps), speed)
            row: dict[str, str | float] = {"log": Path(gps).stem, "speed": speed, **found}
            results.add(**row)
            table.add(*row.values())


if __name__ == "__main__":
    main()
