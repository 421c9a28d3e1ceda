"""A script that smooths recordings with truth that were changed, offline and live.

Errors are unaligned; those of live poses as they came.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.live_runs import run_live, truth_of
from scripts.common.markdown import LiveTable
from vgps.evaluation import trajectory_errors
from vgps.model import FloatArray, IntArray, Recording
from vgps.solution import Trajectory


@dataclass(frozen=True)
class Case:
    """A changed recording.

    Attributes:
        change: What was changed.
        recording: The recording.
        frame: (n,) its frames that count.
        true: (n, 4, 4) their true poses.
    """

    change: int | str
    recording: Recording
    frame: IntArray
    true: FloatArray


Cases = Callable[[Recording, FloatArray], Iterable[Case]]
"""Function of a recording and its true poses (F, 4, 4)."""


def print_both_ways(
    script: str,
    question: str,
    change: str,
    gps: str,
    cases: Callable[[Recording, FloatArray], Iterable[Case]],
) -> None:
    """Run the script: print a markdown table, two rows per recording, case and seed.

    Args:
        script: Its name.
        question: Its docstring.
        change: Name of the change in a row of the results.
        gps: Log that is taken if none is named.
        cases: What is changed.
    """
    parser = ScriptParser(script, question)
    parser.add_argument("recordings", nargs="+", type=Path, help="with truth")
    parser.add_argument("--gps", default=gps, help="log in the recordings")
    add_seeds(parser, 1)
    given = parser.parse_args()
    table = LiveTable("recording", change, "seed", "", "mean [m]", "largest", "rotation [degrees]", "largest")
    with parser.refusals():
        results = parser.results(given)
        for folder in given.recordings:
            recording = vgps.open_recording(folder, gps=given.gps)
            for case in cases(recording, truth_of(recording).world_T_camera):
                for seed in range(given.seeds):
                    for mode, poses in _both_ways(case.recording, seed):
                        row = pose_errors(case, poses)
                        at = {"recording": folder.name, change: case.change, "seed": seed, "mode": mode}
                        results.add(**at, **row)
                        table.add(*map(str, at.values()), *row.values())


def pose_errors(case: Case, poses: FloatArray) -> dict[str, float]:
    """Return errors of those of the poses (F, 4, 4) that count and are known."""
    posed = np.isfinite(poses[case.frame, 0, 3])
    if not posed.any():
        return dict.fromkeys(("mean_m", "max_m", "rotation_deg", "rotation_max_deg"), np.nan)
    frame = case.frame[posed]
    t_s = case.recording.video.times_s[frame]
    found = trajectory_errors(
        Trajectory(t_s, poses[frame]), Trajectory(t_s, case.true[posed]), case.recording.rig.camera_p_antenna
    )
    return {
        "mean_m": found.camera_position_m.mean,
        "max_m": found.camera_position_m.max,
        "rotation_deg": found.rotation_deg.mean,
        "rotation_max_deg": found.rotation_deg.max,
    }


def _both_ways(recording: Recording, seed: int) -> Iterator[tuple[str, FloatArray]]:
    """Yield poses (F, 4, 4), offline and live, with the name of the mode."""
    yield "offline", vgps.smooth(recording, vgps.Config(seed=seed)).world_T_camera
    yield "live", np.array([one.global_T_camera for one in run_live(recording, seed).estimates])
