"""What do places seen again do for the accuracy, and is any of them wrong?

For each recording with truth, from one front end: stage D without loops and with them. A wrong loop ties
frames that were never near each other; the largest distance between tied frames, by the truth, shows it.
"""

from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from vgps.cli.terminal import TerminalProgress
from vgps.config import LoopsConfig
from vgps.evaluation import evaluate
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.offline import optimise_all
from vgps.readers.trajectory import read_trajectory

COLUMNS = ["recording", "loops", "frames", "ties", "tied at most [m]", "mean [m]", "max [m]", "stage D [s]"]


def one_run(recording: Path, front_end: FrontEnd, close: bool) -> dict[str, str | int | float]:
    """Return the result of stage D, with loops or without.

    Raises:
        VgpsError: Stage D finds no solution.
    """
    config = vgps.Config(loops=LoopsConfig(close="auto" if close else "no"))
    solution = optimise_all(front_end, config, TerminalProgress())
    error = evaluate(solution, recording / "truth.tum").camera_position_m
    apart = distances_m(solution, recording)
    return {
        "recording": recording.name,
        "loops": "yes" if close else "no",
        "frames": len(solution.t_s),
        "ties": len(solution.loops),
        "largest_distance_m": float(apart.max()) if len(apart) else 0.0,
        "mean_m": error.mean,
        "max_m": error.max,
        "batch_s": solution.seconds["batch"],
    }


def distances_m(solution: vgps.Solution, recording: Path) -> FloatArray:
    """Return the true distances (n,) between the frames that loops tie."""
    truth = read_trajectory(recording / "truth.tum")
    first, last = truth.t_s[[0, -1]]
    centres = interpolate_poses(truth.t_s, truth.world_T_camera, np.clip(solution.t_s, first, last))[:, :3, 3]
    later, earlier = solution.loops.T
    return np.asarray(np.linalg.norm(centres[later] - centres[earlier], axis=1))


def main() -> None:
    """Print two rows per recording as they come."""
    parser = ScriptParser("benchmarks.loops", __doc__)
    parser.add_argument("recordings", type=Path, nargs="+", help="with truth")
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for recording in given.recordings:
            opened = vgps.open_recording(recording)
            front_end = run_front_end(opened, vgps.Config(), TerminalProgress())
            for close in (False, True):
                found = one_run(recording, front_end, close)
                results.add(**found)
                table.add(*(f"{x:.3f}" if isinstance(x, float) else str(x) for x in found.values()))


if __name__ == "__main__":
    main()
