"""Stage D's problem, solved by vgps and by COLMAP; with --end-to-end, COLMAP's own way from images to poses.

Poses, landmarks and observations are those of a run folder, every pixel with the same sigma; the fixes that
it used are a prior each on the camera's centre, at the nearest frame and less the lever arm, which COLMAP
does not know. Both start from the same poses and points, drifted and then aligned with the priors. Each is
given the least number of iterations after which its cost, by vgps's cost function, is within a share of the
lowest that any of them found; these are timed. Writing and reading the problem is not in the time, setting up
the optimiser is.
"""

import argparse
import os
import platform
import statistics
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pycolmap

import vgps
from scripts.common.colmap_peer import Adjusted, adjust, map_images
from scripts.common.colmap_problem import centre_priors, make_problem
from vgps.geometry import interpolate_poses
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.timing import one_after_another
from vgps.solution import Solution, Trajectory
from vgps.solver.problem import BundleProblem, cost_terms
from vgps.solver.schur_complement import SolverSettings, solve

MOST, TIGHT = 100, 1e-8  # iterations, and the share of the cost, that end the search for the minimum
Engine = Callable[[int, float], Adjusted]


def by_vgps(problem: BundleProblem, most: int, tolerance: float) -> Adjusted:
    """As :func:`colmap_peer.adjust`."""
    settings = SolverSettings(max_iterations=most, relative_tolerance=tolerance)
    wall, cpu = time.perf_counter(), time.process_time()
    result = solve(problem, settings)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return Adjusted(result.problem, result.report.iterations, wall, cpu)


def cost_of(result: Adjusted) -> float:
    """Our cost of where an engine ended."""
    return sum(cost_terms(result.problem).values())


def least_iterations(engine: Engine, longest: int, target: float) -> int:
    """How many iterations bring the cost to the target, by bisection: costs never rise."""
    low, high = 0, longest
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if cost_of(engine(middle, 0.0)) <= target else (middle, high)
    return high


def compare(engines: dict[str, Engine], within: float, repeats: int) -> None:
    """Print a row per engine; the first is what the others are compared with."""
    ends = {name: engine(MOST, TIGHT) for name, engine in engines.items()}
    costs = {name: cost_of(end) for name, end in ends.items()}
    target = (1.0 + within) * min(costs.values())
    print(f"target: cost {target:.6g}\n")
    print("| engine | lowest cost | cost timed | iterations | wall [s] | CPU [s] | wall a step [s] | "
          "CPU a step [s] | wall ratio | CPU ratio |\n" + "|---" * 10 + "|")  # fmt: skip
    reference: tuple[float, float] | None = None
    for name, engine in engines.items():
        steps = max(ends[name].iterations, 1)
        reached = costs[name] <= target
        steps = least_iterations(engine, steps, target) if reached else steps
        runs = [engine(steps, 0.0) for _ in range(repeats)]
        wall, cpu = (statistics.median(getattr(r, what) for r in runs) for what in ("wall_s", "cpu_s"))
        reference = reference or (wall, cpu)
        figures = [wall, cpu, wall / steps, cpu / steps, wall / reference[0], cpu / reference[1]]
        note = "" if reached else " (target not reached)"
        row = f"| {name}{note} | {costs[name]:.6g} | {cost_of(runs[0]):.6g} | {steps} | "
        print(row + " | ".join(f"{x:.3g}" for x in figures) + " |", flush=True)


def end_to_end(run: Solution, folder: Path, every: int, most: int | None, seed: int) -> None:
    """Print the camera's unaligned errors against the truth, and seconds, of a run and of COLMAP's mapping.

    COLMAP's priors have the lever arm and the motion between fix and frame from the run, which favours it.
    """
    recording = vgps.open_recording(folder, with_gps=False)
    truth = read_trajectory(folder / "truth.tum", video_start_s=recording.rig.video_start_s)
    taken = recording.video.times_s[::every][:most]

    def row(name: str, found: Trajectory, seconds: dict[str, float]) -> None:
        at = interpolate_poses(truth.t_s, truth.world_T_camera, found.t_s)
        error = found.world_T_camera[:, :3, 3] - at[:, :3, 3]
        size = np.linalg.norm(error, axis=1)
        spread = f"{size.mean():.3f} | {size.max():.3f}" if len(size) else "- | -"
        steps = ", ".join(f"{step} {s:.1f}" for step, s in seconds.items())
        whole = one_after_another(seconds)
        print(f"| {name} | {len(size)} of {len(taken)} | {spread} | {whole:.1f} | {steps} |")

    found, seconds = map_images(recording, every, most, centre_priors(run, every, all_fixes=True), seed)
    print("\n| method | frames posed | mean error [m] | max [m] | wall [s] | of which |\n" + "|---" * 6 + "|")
    same = np.isin(run.t_s, taken)
    ours = Trajectory(run.t_s[same], run.world_T_camera[same])
    row("vgps, all frames, judged on these; seconds as the run noted", ours, dict(run.seconds))
    row(f"COLMAP, every {every}th frame", found, seconds)


def machine() -> str:
    """Processor, cores and versions."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    model = next((x.split(":")[1].strip() for x in lines if x.startswith("model name")), platform.processor())
    load = os.getloadavg()[0]
    versions = f"Python {platform.python_version()}, pycolmap {pycolmap.__version__}"
    return f"{model}, {os.cpu_count()} cores, load {load:.1f} at the start; {versions}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--frames", type=int, help="only so many of the run's first frames")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument(
        "--within", type=float, default=1e-3, help="how near to the lowest cost is near enough"
    )
    parser.add_argument("--sigma-px", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--end-to-end", action="store_true", help="minutes; only with a truth in the recording"
    )
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--most", type=int, help="end to end: so many images at most")
    given = parser.parse_args()
    pycolmap.logging.minloglevel = 1  # warnings: of priors that it leaves out, for example
    run = read_run(given.run)
    frames = min(given.frames or len(run.t_s), len(run.t_s))
    priors = centre_priors(run).first(frames)
    problem = make_problem(run, priors, frames, given.sigma_px, given.seed)
    print(machine())
    start = sum(cost_terms(problem).values())
    print(
        f"{frames} frames, {len(problem.world_p_landmark)} landmarks, {len(problem.frame)} observations, "
        f"{len(priors.frame)} priors; cost at the start {start:.6g}"
    )
    engines: dict[str, Engine] = {"vgps": partial(by_vgps, problem)}
    for threads in (1, 2):
        name = f"COLMAP, {threads} thread{'s' * (threads > 1)}"
        engines[name] = partial(adjust, problem, priors, run, threads)
    compare(engines, given.within, given.repeats)
    if given.end_to_end:
        assert run.recording is not None
        end_to_end(run, run.recording, given.every, given.most, given.seed)


if __name__ == "__main__":
    main()
