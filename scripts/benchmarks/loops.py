"""What do places seen again do for the accuracy, and is any of them wrong?

For each recording with truth, from one front end: stage D without loops and with them. The landmarks of an
earlier frame, seen by the true pose of the later frame relative to it, lie some pixels from where the loop
found them: the error of a right loop is that of their depths; a wrong loop is off by the whole image.
With --back the video is played forward and then backward: one pass first, then there and back.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from scripts.common.there_and_back import one_pass, there_and_back, truth_there_and_back
from vgps.cli.terminal import TerminalProgress
from vgps.config import LoopsConfig
from vgps.evaluation import evaluate
from vgps.geometry import interpolate_poses, project
from vgps.model import FloatArray, Recording
from vgps.pipeline.front_end import FrontEnd, run_front_end
from vgps.pipeline.offline import optimise_all
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Trajectory

COLUMNS = ["recording", "loops", "frames", "ties", "worst tie [px]", "mean [m]", "max [m]", "stage D [s]"]


def one_run(name: str, truth: Trajectory, front_end: FrontEnd, close: bool) -> dict[str, str | int | float]:
    """Return the result of stage D, with loops or without.

    Raises:
        VgpsError: Stage D finds no solution.
    """
    config = vgps.Config(loops=LoopsConfig(close="auto" if close else "no"))
    solution = optimise_all(front_end, config, TerminalProgress())
    error = evaluate(solution, truth).camera_position_m
    misfit = misfits_px(solution, truth)
    return {
        "recording": name,
        "loops": "yes" if close else "no",
        "frames": len(solution.t_s),
        "ties": len(solution.loops),
        "largest_misfit_px": float(misfit.max()) if len(misfit) else 0.0,
        "mean_m": error.mean,
        "max_m": error.max,
        "batch_s": solution.seconds["batch"],
    }


def misfits_px(solution: vgps.Solution, truth: Trajectory) -> FloatArray:
    """Return for each loop (n,) the median distance of its landmarks from where the true poses see them."""
    first, last = truth.t_s[[0, -1]]
    true = interpolate_poses(truth.t_s, truth.world_T_camera, np.clip(solution.t_s, first, last))
    seen, points = solution.observations, solution.landmarks.world_p_landmark
    misfits = []
    for later, earlier in solution.loops.tolist():
        rows = np.flatnonzero(seen.frame == later)
        rows = rows[np.isin(seen.landmark[rows], seen.landmark[seen.frame == earlier])]
        true_T_world = true[earlier] @ np.linalg.inv(solution.world_T_camera[earlier])
        there = points[seen.landmark[rows]] @ true_T_world[:3, :3].T + true_T_world[:3, 3]
        uv, _ = project(solution.camera.K, true[later], there)
        misfits.append(np.median(np.linalg.norm(uv - seen.uv_px[rows], axis=1)))
    return np.array(misfits)


def cases(given: argparse.Namespace) -> Iterator[tuple[str, Recording, Trajectory]]:
    """Yield name, recording and truth of what is to be smoothed."""
    for path in given.recordings:
        opened, truth = vgps.open_recording(path, gps=given.gps), read_trajectory(path / "truth.tum")
        if given.back is None:
            yield path.name, opened, truth
            continue
        way_back = vgps.open_recording(path, gps=given.back)
        for log in (opened, way_back):
            yield f"{path.name}, one pass", one_pass(log, given.frames), truth
        made = there_and_back(opened, way_back, given.frames)
        yield f"{path.name}, there and back", made, truth_there_and_back(truth, made)


def main() -> None:
    """Print two rows per recording as they come."""
    parser = ScriptParser("benchmarks.loops", __doc__)
    parser.add_argument("recordings", type=Path, nargs="+", help="with truth")
    parser.add_argument("--gps", help="log of the way there, if not the only one")
    parser.add_argument("--back", help="log of the way back")
    parser.add_argument("--frames", type=int, default=400, help="frames of the way there, with --back")
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for name, recording, truth in cases(given):
            front_end = run_front_end(recording, vgps.Config(), TerminalProgress())
            for close in (False, True):
                found = one_run(name, truth, front_end, close)
                results.add(**found)
                table.add(*found.values())


if __name__ == "__main__":
    main()
