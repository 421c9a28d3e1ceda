"""Are the stated standard deviations honest? NEES of poses over simulated walks with exact truth.

NEES is the squared error over the stated variance, averaged over three axes: 1 is honest, more is
overconfident. Errors of neighbouring frames are alike, so that a walk is worth little more than one sample;
the scatter over seeds shows it. A walk takes 9 s of processor time to render and 7 s to smooth, so a hundred
take half an hour of it; kept in --walks they are rendered once.

On ten metres of a nearly straight walk the fixes hardly determine the camera's roll, and its prior stands
behind the standard deviations. So every walk's camera has a random roll of the prior's standard deviation.
--fitted gives the regions that a long survey of the simulated receiver would.
"""

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_jobs, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from scripts.common.short_walks import Ratios, ratios, short_walk
from vgps.config import Config, Region, read_config
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FloatArray
from vgps.simulate import simulate
from vgps.simulate.sensor_config import FIX_ERRORS

AXES = ("east", "north", "up")


def settings(seed: int, given: argparse.Namespace) -> Config:
    """Return the configuration of one walk."""
    config = read_config(given.config).with_seed(seed)
    if not given.fitted:
        return config
    regions = {
        name: Region(
            r_m=INSIDE_PLANE * errors.total_m[0],
            h_m=INSIDE_LINE * errors.total_m[2],
            correlation_s=2.0 * errors.correlation_s,
        )
        for name, errors in FIX_ERRORS.items()
    }
    return config.model_copy(update={"gps": config.gps.model_copy(update={"regions": regions})})


def one(seed: int, given: argparse.Namespace) -> Ratios:
    """Simulate a walk unless it was kept, smooth it and compare."""
    config = settings(seed, given)
    roll_deg = float(np.random.default_rng([seed, 9]).normal(0.0, config.start.level_sigma_deg))
    with tempfile.TemporaryDirectory() as scratch:
        name = f"walk_{given.seconds:g}_{given.fix_share:g}_{roll_deg:.2f}_{seed}"
        folder = (given.walks or Path(scratch)) / name
        if not folder.exists():  # it appears when it is complete
            simulate(folder, short_walk(given.seconds, given.fix_share, roll_deg), seed)
        return ratios(seed, vgps.smooth(vgps.open_recording(folder), config), read_truth(folder))


def figures(ratio: FloatArray) -> dict[str, float]:
    """Return mean and median of NEES, and the share of errors within two sigma by axis and together."""
    nees, inside = np.mean(ratio**2, axis=1), 100 * np.mean(np.abs(ratio) < 2, axis=0)
    by_axis = {f"inside_{axis}_percent": share for axis, share in zip(AXES, inside, strict=True)}
    means = {"nees_mean": nees.mean(), "nees_median": np.median(nees)}
    return {**means, **by_axis, "inside_percent": inside.mean()}


def cells(found: dict[str, float]) -> tuple[str, str, str]:
    """Return the cells of :func:`figures`."""
    by_axis = " / ".join(f"{found[f'inside_{axis}_percent']:.0f}" for axis in AXES)
    return f"{found['nees_mean']:.2f}, {found['nees_median']:.2f}", by_axis, f"{found['inside_percent']:.0f}"


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    add_seeds(parser, 6)
    parser.add_argument("--first-seed", type=int, default=0)
    add_jobs(parser, "walks")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of a walk")
    parser.add_argument("--fix-share", type=float, default=0.2, help="RTK-fix at either end; 0.5 throughout")
    parser.add_argument("--config", type=Path, help="settings file")
    parser.add_argument("--fitted", action="store_true", help="regions that fit the simulated receiver")
    parser.add_argument("--walks", type=Path, help="folder that keeps the simulated walks, for a second run")
    return parser.parse_args()


def both(seed: int | str, runs: list[Ratios]) -> list[dict[str, Any]]:
    """Return a row for positions and one for rotations of all frames of the walks."""
    return [
        {
            "seed": seed,
            "quantity": quantity,
            f"error_{unit}": np.mean([getattr(run, f"{quantity}_{unit}") for run in runs]),
            **figures(np.concatenate([getattr(run, quantity) for run in runs])),
        }
        for quantity, unit in (("position", "m"), ("rotation", "deg"))
    ]


def main() -> None:
    """Print a markdown table, two rows per seed and two for all."""
    parser = ScriptParser("experiments.nees", __doc__)
    given = arguments(parser)
    columns = ("seed", "quantity", "mean error", "NEES: mean, median", "% within 2 sigma, by axis")
    runs: list[Ratios] = []
    table = LiveTable(*columns, "all (honest: 95)")

    def show(rows: list[dict[str, Any]]) -> None:
        for one_row in rows:
            results.add(**one_row)
            name, unit = ("error_m", "m") if "error_m" in one_row else ("error_deg", "deg")
            begin = (str(one_row["seed"]), one_row["quantity"], f"{one_row[name]:.3f} {unit}")
            table.add(*begin, *cells(one_row))

    with parser.refusals(), ProcessPoolExecutor(given.jobs) as pool:
        results = parser.results(given)
        seeds = range(given.first_seed, given.first_seed + given.seeds)
        for run in pool.map(one, seeds, [given] * given.seeds):
            runs.append(run)
            show(both(run.seed, [run]))
        show(both("all", runs))


if __name__ == "__main__":
    main()
