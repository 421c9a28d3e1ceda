"""Are an IMU's biases and the gravity that it shows within their stated standard deviations?

Walks with exact truth and a consumer IMU, whose biases walk, are simulated and smoothed. Compared with their
standard deviations are the biases in the middle of the walk (`sensors.imu` of `solution.json`), the tilt,
that is the rotation of every frame about east and north, and the positions. NEES is the squared error over
the stated variance, per axis: 1 is honest, more is overconfident; the last columns hold 95 % of what honest
standard deviations would give by chance, if a walk is one sample per axis. A walk takes 6 s of processor time
to render and to smooth; kept in --walks they are rendered once.
"""

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

import vgps
from scripts.common.command import ScriptParser, add_jobs, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from scripts.common.short_walks import ratios, short_walk
from vgps.config import read_config
from vgps.model import FloatArray
from vgps.simulate import AccelerometerConfig, simulate

QUANTITIES = {"accelerometer": 3, "gyro": 3, "tilt": 2, "position": 3}  # and their axes
_ROLL_SIGMA_DEG = 5.0  # of the camera: gravity has to show it
_WITHIN = 3.0


def bias_ratios(solution: vgps.Solution, truth: Path) -> dict[str, FloatArray]:
    """Return the errors of both biases over their standard deviations, (1, 3) in the IMU's axes.

    Args:
        solution: With an IMU.
        truth: ``imu_biases.csv`` of the simulation.
    """
    rows = np.genfromtxt(truth, delimiter=",", skip_header=1)
    middle = rows[np.abs(rows[:, 0] - solution.t_s[len(solution.t_s) // 2]).argmin()]
    found, true = solution.sensors.imu, {"gyro": middle[1:4], "accelerometer": middle[4:]}
    units = {"gyro": "rad_s", "accelerometer": "m_s2"}
    return {
        name: ((np.array(found[f"{name}_{unit}"]) - true[name]) / found[f"{name}_sigma_{unit}"])[None]
        for name, unit in units.items()
    }


def one(seed: int, given: argparse.Namespace) -> dict[str, FloatArray]:
    """Simulate a walk unless it was kept, smooth it, and return errors over standard deviations."""
    roll_deg = float(np.random.default_rng([seed, 9]).normal(0.0, _ROLL_SIGMA_DEG))
    walk = replace(
        short_walk(given.seconds, given.fix_share, roll_deg),
        shake_deg=given.shake_deg,
        accelerometer=AccelerometerConfig(),
    )
    name = f"imu_{given.seconds:g}_{given.fix_share:g}_{walk.shake_deg:g}_{seed}"
    with tempfile.TemporaryDirectory() as scratch:
        folder = (given.walks or Path(scratch)) / name
        if not folder.exists():  # it appears when it is complete
            simulate(folder, walk, seed)
        solution = vgps.smooth(vgps.open_recording(folder), read_config(given.config).with_seed(seed))
        poses = ratios(seed, solution, read_truth(folder))
        biases = bias_ratios(solution, folder / "imu_biases.csv")
    return {**biases, "tilt": poses.rotation[:, :2], "position": poses.position}


def figures(ratio: FloatArray) -> dict[str, float]:
    """Return NEES, the share within three standard deviations, and the largest ratio."""
    size = np.abs(ratio)
    return {
        "nees": float(np.mean(size**2)),
        "within_3_sigma_percent": float(100.0 * np.mean(size <= _WITHIN)),
        "largest_ratio": float(size.max()),
    }


def by_chance(samples: int) -> tuple[float, float]:
    """Return the limits of 95 % of the NEES of independent samples under honest standard deviations."""
    return float(chi2.ppf(0.025, samples)) / samples, float(chi2.ppf(0.975, samples)) / samples


def main() -> None:
    """Print a row of NEES per walk, and a row per quantity for all."""
    parser = ScriptParser("experiments.imu_sigmas", __doc__)
    add_seeds(parser, 20)
    add_jobs(parser, "walks")
    parser.add_argument("--seconds", type=float, default=10.0, help="length of a walk")
    parser.add_argument("--fix-share", type=float, default=0.5, help="RTK-fix at either end; 0.5 throughout")
    parser.add_argument("--shake-deg", type=float, default=1.0, help="shaking of the camera")
    parser.add_argument("--config", type=Path, help="settings file")
    parser.add_argument("--walks", type=Path, help="folder that keeps the simulated walks, for a second run")
    given = parser.parse_args()
    with parser.refusals(), ProcessPoolExecutor(given.jobs) as pool:
        results, runs = parser.results(given), []
        walks = LiveTable("seed", *(f"NEES {name}" for name in QUANTITIES), numbers=".2f")
        for seed, run in enumerate(pool.map(one, range(given.seeds), [given] * given.seeds)):
            runs.append(run)
            nees = {name: figures(run[name])["nees"] for name in QUANTITIES}
            results.add(seed=seed, **{f"nees_{name}": value for name, value in nees.items()})
            walks.add(seed, *nees.values())
        names = "all walks", "NEES", "% within 3 sigma", "largest ratio", "by chance from", "to"
        table = LiveTable(*names, numbers=".2f")
        for name, axes in QUANTITIES.items():
            found = figures(np.concatenate([run[name] for run in runs]))
            limits = by_chance(axes * given.seeds)
            results.add(seed="all", quantity=name, by_chance=limits, **found)
            table.add(name, *found.values(), *limits)


if __name__ == "__main__":
    main()
