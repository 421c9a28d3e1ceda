"""Does a short clip show the wrong clock of a long log?

Clips are cut from recordings with truth, one after the other. The path of each is that of the video alone;
the fixes of whole logs, their time stamps moved, are compared with it as `vgps smooth` does. A time offset
is right within what is searched about it afterwards.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import vgps
from scripts.common.command import ScriptParser
from scripts.common.drives import Drive, open_drive
from scripts.common.markdown import LiveTable
from vgps.gps.clock_search import levelled, search_time_offset
from vgps.gps.fixes import Fixes
from vgps.gps.world_frame import world_fixes
from vgps.pipeline.front_end import run_front_end
from vgps.pipeline.rough_solution import video_alone
from vgps.pipeline.solved_maps import merged_maps
from vgps.runtime.progress import NoProgress
from vgps.solution import Trajectory

RIGHT, NONE, WRONG = "right", "none", "wrong"


def clips(name: str, seconds: float, data: Path) -> Iterator[Drive]:
    """Yield the clips of a recording, so long each."""
    times_s = open_drive(name, data, data).recording.video.times_s
    frames = int(np.searchsorted(times_s, times_s[0] + seconds))
    for first in range(0, len(times_s) - frames, frames):
        yield open_drive(f"{name}:{first}-{first + frames}", data, data)


def path_of_video(clip: Drive, config: vgps.Config) -> Trajectory:
    """Return the path that the video alone shows."""
    alone = run_front_end(clip.recording, config, NoProgress())
    return levelled(video_alone(alone, merged_maps(alone, alone.context(config)), config), config.start)


def fixes_of(whole: Drive, file: Path, config: vgps.Config) -> Fixes:
    """Return the fixes of a log in the world, at times of the whole recording."""
    return world_fixes(replace(whole.recording, gps=whole.read_log(file)), config)[1]


def verdict(found_s: float | None, late_s: float, config: vgps.Config) -> str:
    """Return what a found time offset is worth."""
    if found_s is None:
        return NONE
    return RIGHT if abs(found_s - late_s) <= config.sensors.time_offset_reach_s else WRONG


def rows(name: str, seconds: float, late_s: list[float], data: Path) -> Iterator[dict[str, Any]]:
    """Yield a row per clip, log and clock of a recording."""
    config, whole = vgps.Config(), open_drive(name, data, data)
    logs = {log: fixes_of(whole, file, config) for log, file in whole.shipped().items()}
    for clip in clips(name, seconds, data):
        path, antenna = path_of_video(clip, config.with_gps("none")), clip.recording.rig.camera_p_antenna
        for log, fixes in logs.items():
            for late in late_s:
                moved = replace(fixes, t_s=fixes.t_s - clip.start_s + late)
                found_s = search_time_offset(path, moved, antenna, config.sensors)
                yield {
                    "clip": clip.name,
                    "log": log,
                    "late_s": late,
                    "found_s": found_s,
                    "verdict": verdict(found_s, late, config),
                }


def main() -> None:
    """Print a markdown table, a row per recording, length and log."""
    parser = ScriptParser("experiments.clip_clocks", __doc__)
    parser.add_argument("recordings", nargs="+", help="with truth, in the folder of --data")
    parser.add_argument("--seconds", nargs="+", type=float, default=[10.0, 15.0], help="lengths of clips")
    parser.add_argument("--late", nargs="+", type=float, default=[3.4, -7.0], help="time offsets, seconds")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the recordings")
    given = parser.parse_args()
    table = LiveTable("recording", "clips of [s]", "log", RIGHT, NONE, WRONG)
    with parser.refusals():
        results = parser.results(given)
        for name in given.recordings:
            for seconds in given.seconds:
                counts: dict[str, Counter[str]] = {}
                for row in rows(name, seconds, given.late, given.data):
                    results.add(recording=name, seconds=seconds, **row)
                    counts.setdefault(row["log"], Counter())[row["verdict"]] += 1
                for log, of_log in counts.items():
                    numbers = (str(of_log[one]) for one in (RIGHT, NONE, WRONG))
                    table.add(name, f"{seconds:g}", log, *numbers)


if __name__ == "__main__":
    main()
