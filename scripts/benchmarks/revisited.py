"""How long do ten iterations take on a problem of KITTI 00's size, with loops, beside COLMAP's?

Landmarks are simulated along the path. The size is that of ORB-SLAM2's map of KITTI 00, of which
https://github.com/fixstars/cuda-bundle-adjustment publishes 11.9 s by g2o and 1.23 s by a GTX 1080. Both
engines start from the same values and have the same priors on positions; no tolerance ends them early.
Writing and reading the problem is not in the time, setting up the optimiser is.
"""

import argparse
from functools import partial
from pathlib import Path

import pycolmap

from scripts.common.colmap_peer import AdjustmentResult, Engine, adjust, by_vgps, cost_of
from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from scripts.common.results import Results
from scripts.common.revisited_path import CAMERA, ProblemSize, simulate_problem
from vgps.readers.kitti_poses import read_kitti_poses
from vgps.solver.cost import cost_terms

PUBLISHED_S = {"g2o": 11.9, "GTX 1080": 1.23}
KITTI_00 = ProblemSize(frames=1332, landmarks=133_000, observations=561_000)


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("path", type=Path, help="poses as KITTI writes them")
    for name, value in vars(KITTI_00).items():
        parser.add_argument(f"--{name}", type=int, default=value, help="number")
    parser.add_argument("--iterations", type=int, default=10, help="of each run")
    parser.add_argument("--repeats", type=int, default=3, help="rounds of all engines; the least time counts")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], help="of COLMAP")
    parser.add_argument("--seed", type=int, default=0, help="of the simulation")
    return parser.parse_args()


def measure(engines: dict[str, Engine], given: argparse.Namespace, results: Results) -> None:
    """Print a row per engine; ratios are to the first."""
    runs: dict[str, list[AdjustmentResult]] = {name: [] for name in engines}
    for _ in range(given.repeats):
        for name, engine in engines.items():
            runs[name].append(engine(given.iterations, 0.0))
    table = LiveTable(
        "engine", "iterations", "cost", "wall [s]", "CPU [s]", "wall ratio", "CPU ratio", numbers=".3g"
    )
    first = runs[next(iter(runs))]
    for name, found in runs.items():
        wall_s, cpu_s = (min(times) for times in _times(found))
        end = {"iterations": found[0].iterations, "cost": cost_of(found[0])}
        results.add(engine=name, **end, wall_s=wall_s, cpu_s=cpu_s)
        ratios = (time / min(best) for time, best in zip((wall_s, cpu_s), _times(first), strict=True))
        table.add(name, end["iterations"], f"{end['cost']:.8g}", wall_s, cpu_s, *ratios)


def _times(runs: list[AdjustmentResult]) -> tuple[list[float], list[float]]:
    return [run.wall_s for run in runs], [run.cpu_s for run in runs]


def main() -> None:
    """Print the table."""
    parser = ScriptParser("benchmarks.revisited", __doc__)
    given = arguments(parser)
    size = {name: getattr(given, name) for name in vars(KITTI_00)}
    with parser.refusals():
        results, poses = parser.results(given), read_kitti_poses(given.path)
        try:
            problem, priors = simulate_problem(poses, ProblemSize(**size), given.seed)
        except ValueError as error:
            parser.error(str(error))
        before = sum(cost_terms(problem).values())
        print(", ".join(f"{count} {what}" for what, count in size.items()), end="; ")
        print(f"pycolmap {pycolmap.__version__}; cost at the start {before:.6g}\n")
        results.summarise(**size, cost_before=before, published_s=PUBLISHED_S, pycolmap=pycolmap.__version__)
        engines: dict[str, Engine] = {"vgps": partial(by_vgps, problem)}
        for threads in given.threads:
            name = f"COLMAP, {threads} thread{'s' * (threads > 1)}"
            engines[name] = partial(adjust, problem, priors, CAMERA, threads)
        measure(engines, given, results)


if __name__ == "__main__":
    main()
