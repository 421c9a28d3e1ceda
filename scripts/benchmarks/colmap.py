"""How fast is stage D beside COLMAP's bundle adjustment, on the same problem from the same start?

Poses, landmarks and observations are those of a run folder, every pixel with the same sigma; the fixes that
it used are priors on the camera's centre at the nearest frame, less the lever arm, which COLMAP does not
have. Both start from the same poses and points, drifted and then aligned with the priors. Each gets the least
number of iterations after which its cost, by vgps's cost function, is within a share of the lowest that any
of them reached; these are timed. Writing and reading the problem is not in the time, setting up the optimiser
is.

With --end-to-end (about ten minutes) COLMAP also maps every n-th image from nothing, and both are compared
with the recording's truth.
"""

import argparse
import statistics
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

import vgps
from scripts.common.colmap_peer import Engine, adjust, by_vgps, cost_of, map_images
from scripts.common.colmap_problem import centre_priors, make_problem
from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from scripts.common.results import Results
from vgps.errors import RunFolderError
from vgps.geometry import interpolate_poses
from vgps.readers.run_folder import read_run
from vgps.runtime.timing import sequential_seconds
from vgps.solution import Solution, Trajectory
from vgps.solver.cost import cost_terms

ITERATIONS, TIGHT = 100, 1e-8  # and the share of the cost, that end the search for the minimum


def least_iterations(engine: Engine, longest: int, target: float) -> int:
    """Return how many iterations bring the cost to the target, by bisection: costs never rise."""
    low, high = 0, longest
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if cost_of(engine(middle, 0.0)) <= target else (middle, high)
    return high


def compare(engines: dict[str, Engine], within: float, repeats: int, results: Results) -> None:
    """Print a row per engine; ratios are to the first."""
    ends = {name: engine(ITERATIONS, TIGHT) for name, engine in engines.items()}
    costs = {name: cost_of(end) for name, end in ends.items()}
    target = (1.0 + within) * min(costs.values())
    print(f"target: cost {target:.6g}\n")
    names = ("engine", "lowest cost", "cost timed", "iterations", "wall [s]", "CPU [s]")
    table = LiveTable(
        *names, "wall per step [s]", "CPU per step [s]", "wall ratio", "CPU ratio", numbers=".3g"
    )
    reference: tuple[float, float] | None = None
    for name, engine in engines.items():
        steps, reached = max(ends[name].iterations, 1), costs[name] <= target
        steps = least_iterations(engine, steps, target) if reached else steps
        runs = [engine(steps, 0.0) for _ in range(repeats)]
        wall_s, cpu_s = (statistics.median(getattr(r, what) for r in runs) for what in ("wall_s", "cpu_s"))
        reference = reference or (wall_s, cpu_s)
        results.add(
            engine=name,
            lowest_cost=costs[name],
            cost=cost_of(runs[0]),
            reached=reached,
            iterations=steps,
            wall_s=wall_s,
            cpu_s=cpu_s,
        )
        figures = [wall_s, cpu_s, wall_s / steps, cpu_s / steps, wall_s / reference[0], cpu_s / reference[1]]
        note = "" if reached else " (target not reached)"
        table.add(f"{name}{note}", f"{costs[name]:.6g}", f"{cost_of(runs[0]):.6g}", steps, *figures)


def end_to_end(run: Solution, folder: Path, given: argparse.Namespace, results: Results) -> None:
    """Print unaligned camera errors against the truth, and seconds, of a run and of COLMAP's mapping.

    COLMAP's priors have the lever arm and the motion between fix and frame from the run, which favours it.
    """
    recording = vgps.open_recording(folder, with_gps=False)
    truth = read_truth(folder)
    table = LiveTable("method", "frames posed", "mean error [m]", "max [m]", "wall [s]", "of which")
    taken = recording.video.times_s[:: given.every][: given.limit]

    def add(method: str, found: Trajectory, seconds: dict[str, float]) -> None:
        true = interpolate_poses(truth.t_s, truth.world_T_camera, found.t_s)
        size = np.linalg.norm(found.world_T_camera[:, :3, 3] - true[:, :3, 3], axis=1)
        figures: dict[str, Any] = {"posed": len(size), "frames": len(taken)}
        figures |= {"mean_m": size.mean(), "max_m": size.max()} if len(size) else {}
        wall_s = sequential_seconds(seconds)
        results.add(engine=method, **figures, wall_s=wall_s, steps_s=seconds)
        errors = (f"{size.mean():.3f}", f"{size.max():.3f}") if len(size) else ("-", "-")
        steps = ", ".join(f"{step} {s:.1f}" for step, s in seconds.items())
        table.add(method, f"{len(size)} of {len(taken)}", *errors, f"{wall_s:.1f}", steps)

    priors = centre_priors(run, given.every, all_fixes=True)
    found, seconds = map_images(recording, given.every, given.limit, priors, given.seed)
    print()
    same = np.isin(run.t_s, taken)
    ours = Trajectory(run.t_s[same], run.world_T_camera[same])
    add("vgps on all frames, evaluated on these; seconds as the run noted", ours, dict(run.seconds))
    add(f"COLMAP, every {given.every}th frame", found, seconds)


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("run", type=Path, help="run folder")
    parser.add_argument("--frames", type=int, help="only so many of the run's first frames")
    parser.add_argument("--repeats", type=int, default=5, help="runs whose median is taken")
    parser.add_argument("--within", type=float, default=1e-3, help="tolerated share above the lowest cost")
    parser.add_argument("--sigma-px", type=float, default=1.0, help="of every observation")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--end-to-end", action="store_true", help="map from images too; needs a truth")
    parser.add_argument("--every", type=int, default=4, help="end to end: COLMAP gets every n-th frame")
    parser.add_argument("--limit", type=int, help="end to end: so many images at most")
    return parser.parse_args()


def main() -> None:
    """Print the tables."""
    parser = ScriptParser("benchmarks.colmap", __doc__)
    given = arguments(parser)
    pycolmap.logging.minloglevel = 1  # warnings: of priors that it leaves out, for example
    with parser.refusals():
        results, run = parser.results(given), read_run(given.run)
        if given.end_to_end and run.recording is None:
            raise RunFolderError("does not name its recording", file=given.run, expected="one with a truth")
        frames = min(given.frames or len(run.t_s), len(run.t_s))
        priors = centre_priors(run).first(frames)
        problem = make_problem(run, priors, frames, given.sigma_px, given.seed)
        size = {
            "frames": frames,
            "landmarks": len(problem.world_p_landmark),
            "observations": len(problem.frame),
            "priors": len(priors.frame),
        }
        print(", ".join(f"{count} {what}" for what, count in size.items()), end="; ")
        print(f"pycolmap {pycolmap.__version__}; cost at the start {sum(cost_terms(problem).values()):.6g}")
        results.summarise(**size, pycolmap=pycolmap.__version__)
        engines: dict[str, Engine] = {"vgps": partial(by_vgps, problem)}
        for threads in (1, 2):
            name = f"COLMAP, {threads} thread{'s' * (threads > 1)}"
            engines[name] = partial(adjust, problem, priors, run.camera, threads)
        compare(engines, given.within, given.repeats, results)
        if run.recording is not None and given.end_to_end:
            end_to_end(run, run.recording, given, results)


if __name__ == "__main__":
    main()
