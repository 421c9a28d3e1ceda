"""Wrong fixes: stage D with its verdicts beside COLMAP's bundle adjustment, whose priors are plain or Cauchy.

A fix for every frame: the true camera centre, for COLMAP knows no lever arm, with Gaussian noise; a share of
them is thrown off in any direction by a distance within ``--reach``, drawn evenly in its logarithm. All are
labelled RTK-fix, and everyone is told the true sigma of the good ones; vgps as the regions that a survey of
such a receiver would give. Everyone starts from the same drifted poses and landmarks, which a robust fit
moved onto the fixes, and has the same observations. Errors are of the camera centre, unaligned. COLMAP
chooses the priors that it moves the model onto itself; its Cauchy loss has its default scale.
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
from vgps.config import Config, GpsModel, Region
from vgps.gps.fixes import Fixes, fixes_in_world
from vgps.gps.outlier_detection import FixAssessment, detect_outliers, detects_outliers
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.gps.sensors import Sensors
from vgps.model import BoolArray, FixClass, FloatArray, GpsLog
from vgps.readers.calibration import read_rig
from vgps.readers.run_folder import read_run
from vgps.readers.trajectory import read_trajectory
from vgps.smoothing.batch import optimise_batch
from vgps.smoothing.factor_graph import Scene
from vgps.solution import Observations, Solution
from vgps.solver.problem import BundleProblem

OURS: dict[str, GpsModel] = {
    "vgps, cylinder and verdicts": "cylinder",
    "vgps, Gaussian and verdicts": "gaussian-receiver",
    "vgps, Cauchy": "cauchy",
}
COLMAPS = {"COLMAP, plain priors (default)": False, "COLMAP, Cauchy priors": True}
MOST, TOLERANCE = 200, 1e-7


class Found(NamedTuple):
    """Mean error [m]; wrong and good fixes rejected or down-classed; None for who judges none."""

    mean_m: float
    caught: int | None = None
    refused: int | None = None


def fixes_about(
    true: FloatArray, share: float, given: argparse.Namespace, seed: int
) -> tuple[FloatArray, BoolArray]:
    """(F, 3) fixes at true camera centres (F, 3), and (F,) which of them are wrong."""
    rng = np.random.default_rng([seed, round(1000 * share)])
    wrong = np.zeros(len(true), dtype=bool)
    wrong[rng.permutation(len(true))[: round(share * len(true))]] = True
    away = rng.normal(size=true.shape)
    away *= np.exp(rng.uniform(*np.log(given.reach), len(true)))[:, None] / np.linalg.norm(
        away, axis=1, keepdims=True
    )
    return true + given.sigma * rng.normal(size=true.shape) + away * wrong[:, None], wrong


def settings(model: GpsModel, sigma_m: float, seed: int) -> Config:
    """The defaults, with the region that a survey finds where errors are Gaussian and new at every epoch."""
    region = Region(r_m=INSIDE_PLANE * sigma_m, h_m=INSIDE_LINE * sigma_m, correlation_s=0.1)
    config = Config(seed=seed).with_gps(model)
    regions = {**config.gps.regions, FixClass.RTK_FIX: region}
    return config.model_copy(update={"gps": config.gps.model_copy(update={"regions": regions})})


def as_fixes(t_s: FloatArray, world_p_fix: FloatArray, sigma_m: float, config: Config) -> Fixes:
    """As a log of them would be read."""
    unknown = np.full(len(t_s), np.nan)
    log = GpsLog(
        t_s=t_s,
        latitude_deg=unknown,
        longitude_deg=unknown,
        height_m=unknown,
        fix_class=(FixClass.RTK_FIX,) * len(t_s),
        sigma_m=np.full((len(t_s), 3), sigma_m),
        hdop=unknown,
        satellites=unknown,
        correction_age_s=unknown,
        line=np.arange(len(t_s)),
        source=Path("simulated"),
    )
    return fixes_in_world(log, world_p_fix, config.gps)


def by_vgps(
    model: GpsModel, start: BundleProblem, run: Solution, priors: Priors, seed: int
) -> tuple[FloatArray, FixAssessment | None]:
    """Camera centres (F, 3) after stage D, and what it made of the fixes."""
    sigma_m = float(priors.sigma_m[0, 0])
    config = settings(model, sigma_m, seed)
    t_s, antenna = run.t_s[: len(start.world_T_camera)], np.zeros(3)
    fixes = as_fixes(t_s, priors.world_p_camera, sigma_m, config)
    seen = Observations(start.frame, start.landmark, start.uv_px)
    scene = Scene(t_s, start.world_T_camera, start.world_p_landmark, seen)
    judged = detects_outliers(config)
    first = (
        detect_outliers(scene.poses, t_s, fixes, antenna, config) if judged else FixAssessment.none(len(t_s))
    )
    sensors = Sensors.begin(antenna, config.sensors)
    found = optimise_batch(scene, run.camera.K, fixes, sensors, config, assessment=first)
    return found.poses[:, :3, 3], found.assessment if judged else None


def by_colmap(
    robust: bool, start: BundleProblem, run: Solution, priors: Priors, seed: int
) -> tuple[FloatArray, None]:
    """Camera centres (F, 3) after COLMAP's pose-prior bundle adjustment."""
    found = adjust(start, priors, run, 1, MOST, TOLERANCE, robust=robust)
    return found.problem.world_T_camera[:, :3, 3], None


ENGINES = {name: partial(by_vgps, model) for name, model in OURS.items()} | {
    name: partial(by_colmap, robust) for name, robust in COLMAPS.items()
}


def one(share: float, seed: int, run: Solution, true: FloatArray, given: argparse.Namespace) -> list[Found]:
    """Everyone on the same fixes and the same start."""
    world_p_fix, wrong = fixes_about(true, share, given, seed)
    priors = Priors(np.arange(len(true)), world_p_fix, np.full(true.shape, given.sigma))
    start = make_problem(run, priors, len(true), given.sigma_px, seed)
    rows = []
    for engine in ENGINES.values():
        path, verdicts = engine(start, run, priors, seed)
        counts: tuple[int, ...] = ()
        if verdicts is not None:
            doubted = verdicts.rejected | verdicts.lowered
            counts = int((doubted & wrong).sum()), int((doubted & ~wrong).sum())
        rows.append(Found(float(np.linalg.norm(path - true, axis=1).mean()), *counts))
    return rows


def cell(found: list[Found]) -> str:
    """Mean over seeds and range of the error [m], wrong and good fixes doubted on average."""
    means = [one.mean_m for one in found]
    text = f"{statistics.mean(means):.3f} ({min(means):.3f}-{max(means):.3f})"
    if found[0].caught is None:
        return text
    caught, refused = (statistics.mean(getattr(one, name) for one in found) for name in ("caught", "refused"))
    return f"{text}; {caught:.1f}, {refused:.1f}"


def main() -> None:
    """Print a markdown table."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("run", type=Path)
    parser.add_argument("--truth", type=Path, help="by default truth.tum of the run's recording")
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--shares", type=float, nargs="+", default=[0.0, 0.1, 0.3])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--sigma", type=float, default=0.05, help="of the good fixes, metres")
    parser.add_argument("--reach", type=float, nargs=2, default=[1.0, 20.0], help="of the wrong ones, metres")
    parser.add_argument("--sigma-px", type=float, default=1.0, help="of COLMAP's pixels")
    given = parser.parse_args()
    pycolmap.logging.minloglevel = 2
    run = read_run(given.run)
    if run.recording is None and given.truth is None:
        parser.error("the run does not name its recording: give --truth")
    file = given.truth or run.recording / "truth.tum"
    truth = read_trajectory(file, video_start_s=read_rig(file.parent / "rig.yaml").video_start_s)
    same = np.abs(truth.t_s[:, None] - run.t_s[None, : given.frames]).argmin(axis=0)
    true = truth.world_T_camera[same, :3, 3]
    results = {
        share: [one(share, seed, run, true, given) for seed in range(given.seeds)] for share in given.shares
    }
    wrong = [f"{100 * share:g} % ({round(share * len(true))} of {len(true)}) wrong" for share in given.shares]
    print("mean error [m] (range over seeds); wrong fixes and good ones rejected or down-classed\n")
    print(f"| optimiser | {' | '.join(wrong)} |\n" + "|---" * (1 + len(wrong)) + "|")
    for row, name in enumerate(ENGINES):
        cells = [cell([found[row] for found in results[share]]) for share in given.shares]
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
