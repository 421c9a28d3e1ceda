"""What do wrong fixes do to stage D with its outlier detection, and to COLMAP with plain or Cauchy priors?

There is a fix for every frame: the true camera centre, since COLMAP has no lever arm, with Gaussian noise. A
share of them is moved in a random direction by a distance within ``--reach``, uniform in its logarithm. All
are labelled RTK-fix, and every optimiser gets the true sigma of the good ones, vgps as the regions that a
survey of such a receiver would give. All start from the same drifted poses and landmarks, aligned with the
fixes by a robust fit, and have the same observations. Errors are of the camera centre, unaligned. COLMAP
chooses the priors that it aligns the model with itself; its Cauchy loss has its default scale.
"""

import argparse
import statistics
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap

from scripts.common.colmap_peer import adjust
from scripts.common.colmap_problem import Priors, make_problem
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.markdown import mean_and_range, table
from scripts.common.recordings import true_poses
from scripts.common.simulated_fixes import simulated_fixes
from vgps.config import Config, GpsModel, Region
from vgps.gps.outlier_detection import FixAssessment, detect_outliers, detects_outliers
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.gps.sensors import Sensors
from vgps.model import BoolArray, FixClass, FloatArray
from vgps.readers.run_folder import read_run
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.scene import Scene
from vgps.smoothing.stage_d.batch import optimise_batch
from vgps.solution import Observations, Solution
from vgps.solver.problem import BundleProblem

OURS: dict[str, GpsModel] = {
    "vgps, cylinder and verdicts": "cylinder",
    "vgps, Gaussian and verdicts": "gaussian-receiver",
    "vgps, Cauchy": "cauchy",
}
COLMAPS = {"COLMAP, plain priors (default)": False, "COLMAP, Cauchy priors": True}
ITERATIONS, TOLERANCE = 200, 1e-7


class Errors(NamedTuple):
    """Mean error; wrong and good fixes rejected or down-classed, None without outlier detection."""

    mean_m: float
    wrong_doubted: int | None = None
    good_doubted: int | None = None


def fixes_about(
    true: FloatArray, share: float, given: argparse.Namespace, seed: int
) -> tuple[FloatArray, BoolArray]:
    """Return (F, 3) fixes at true camera centres (F, 3), and (F,) which of them are wrong."""
    rng = np.random.default_rng([seed, round(1000 * share)])
    wrong = np.zeros(len(true), dtype=bool)
    wrong[rng.permutation(len(true))[: round(share * len(true))]] = True
    away = rng.normal(size=true.shape)
    least, most = np.log(given.reach)
    away *= np.exp(rng.uniform(least, most, len(true)))[:, None] / np.linalg.norm(away, axis=1, keepdims=True)
    return true + given.sigma * rng.normal(size=true.shape) + away * wrong[:, None], wrong


def settings(model: GpsModel, sigma_m: float, seed: int) -> Config:
    """Return the defaults with the region that a survey finds for Gaussian errors without memory."""
    region = Region(r_m=INSIDE_PLANE * sigma_m, h_m=INSIDE_LINE * sigma_m, correlation_s=0.1)
    config = Config(seed=seed).with_gps(model)
    regions = {**config.gps.regions, FixClass.RTK_FIX: region}
    return config.model_copy(update={"gps": config.gps.model_copy(update={"regions": regions})})


def by_vgps(
    model: GpsModel, start: BundleProblem, run: Solution, priors: Priors, seed: int
) -> tuple[FloatArray, FixAssessment | None]:
    """Return camera centres (F, 3) after stage D, and its assessment of the fixes."""
    sigma_m = float(priors.sigma_m[0, 0])
    config = settings(model, sigma_m, seed)
    t_s, antenna = run.t_s[: len(start.world_T_camera)], np.zeros(3)
    fixes = simulated_fixes(t_s, priors.world_p_camera, FixClass.RTK_FIX, sigma_m, config)
    observations = Observations(start.frame, start.landmark, start.uv_px)
    scene = Scene(t_s, start.world_T_camera, start.world_p_landmark, observations)
    judged = detects_outliers(config)
    first = (
        detect_outliers(scene.trajectory, fixes, antenna, config)
        if judged
        else FixAssessment.unassessed(len(t_s))
    )
    sensors = Sensors.from_config(antenna, config.sensors)
    found = optimise_batch(scene, fixes, sensors, SmoothingContext(run.camera, config), assessment=first)
    return found.trajectory.world_T_camera[:, :3, 3], found.assessment if judged else None


def by_colmap(
    robust: bool, start: BundleProblem, run: Solution, priors: Priors, seed: int
) -> tuple[FloatArray, None]:
    """Return camera centres (F, 3) after COLMAP's pose-prior bundle adjustment."""
    found = adjust(start, priors, run.camera, 1, ITERATIONS, TOLERANCE, robust=robust)
    return found.problem.world_T_camera[:, :3, 3], None


ENGINES = {name: partial(by_vgps, model) for name, model in OURS.items()} | {
    name: partial(by_colmap, robust) for name, robust in COLMAPS.items()
}


def one(share: float, seed: int, run: Solution, true: FloatArray, given: argparse.Namespace) -> list[Errors]:
    """Run every optimiser on the same fixes from the same start."""
    world_p_fix, wrong = fixes_about(true, share, given, seed)
    priors = Priors(np.arange(len(true)), world_p_fix, np.full(true.shape, given.sigma))
    start = make_problem(run, priors, len(true), given.sigma_px, seed)
    rows = []
    for engine in ENGINES.values():
        path, assessment = engine(start, run, priors, seed)
        counts: tuple[int, ...] = ()
        if assessment is not None:
            doubted = assessment.rejected | assessment.down_classed
            counts = int((doubted & wrong).sum()), int((doubted & ~wrong).sum())
        rows.append(Errors(float(np.linalg.norm(path - true, axis=1).mean()), *counts))
    return rows


def cell(found: list[Errors]) -> str:
    """Return mean over seeds and range of the error [m], wrong and good fixes doubted on average."""
    text = mean_and_range([one.mean_m for one in found])
    doubted = [(one.wrong_doubted, one.good_doubted) for one in found if one.wrong_doubted is not None]
    if not doubted:
        return text
    return f"{text}; " + ", ".join(
        f"{statistics.mean(map(float, counts)):.1f}" for counts in zip(*doubted, strict=True)
    )


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("run", type=Path, help="run folder")
    parser.add_argument("--truth", type=Path, help="truth.tum of the run's recording without it")
    parser.add_argument("--frames", type=int, default=60, help="so many of the run's first frames")
    parser.add_argument("--shares", type=float, nargs="+", default=[0.0, 0.1, 0.3], help="of wrong fixes")
    add_seeds(parser, 5)
    parser.add_argument("--sigma", type=float, default=0.05, help="of the good fixes, metres")
    parser.add_argument("--reach", type=float, nargs=2, default=[1.0, 20.0], help="of the wrong ones, metres")
    parser.add_argument("--sigma-px", type=float, default=1.0, help="of COLMAP's pixels")
    return parser.parse_args()


def main() -> None:
    """Print a markdown table."""
    parser = ScriptParser("benchmarks.outliers", __doc__)
    given = arguments(parser)
    pycolmap.logging.minloglevel = 2
    found: dict[float, list[list[Errors]]] = {share: [] for share in given.shares}
    with parser.refusals():
        results, run = parser.results(given), read_run(given.run)
        true = true_poses(run, given.run, given.truth)[: given.frames, :3, 3]
        for share in given.shares:
            for seed in range(given.seeds):
                found[share].append(one(share, seed, run, true, given))
                for name, errors in zip(ENGINES, found[share][-1], strict=True):
                    results.add(optimiser=name, share=share, seed=seed, **errors._asdict())
    print("mean error [m] (range over seeds); wrong and good fixes rejected or down-classed\n")
    wrong = [f"{100 * share:g} % ({round(share * len(true))} of {len(true)}) wrong" for share in found]
    rows = (
        [name, *(cell([errors[row] for errors in seeds]) for seeds in found.values())]
        for row, name in enumerate(ENGINES)
    )
    print(table(["optimiser", *wrong], rows))


if __name__ == "__main__":
    main()
