"""Are the stated standard deviations honest? NEES of poses over simulated walks with exact truth.

NEES is the squared error over the stated variance, summed over three axes and divided by three: 1 is honest,
more is overconfident. Errors of neighbouring frames are alike, so a walk is worth little more than one
sample; the scatter over seeds tells. A walk takes 9 s of processor time to render and 7 s to smooth, so 100
take half an hour of it, a quarter on two cores; kept in --walks they are rendered once.

On ten metres of a nearly straight walk fixes hardly show the camera's roll; what is believed of it then
stands behind the standard deviations. So every walk's camera is held as much askew as is believed: by a
random roll of that standard deviation. --fitted gives the regions that a long survey of the simulated
receiver would.
"""

import argparse
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

import vgps
from vgps.config import Config, Region, read_config
from vgps.evaluation import match_times
from vgps.gps.regions import INSIDE_LINE, INSIDE_PLANE
from vgps.model import FloatArray
from vgps.readers.calibration import read_rig
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, SceneConfig, simulate
from vgps.simulate.scene import FIX_ERRORS
from vgps.solution import Solution, Trajectory


class Ratios(NamedTuple):
    """Errors over their standard deviations, (F, 3) each: positions east, north, up; rotations about them."""

    seed: int
    position: FloatArray
    rotation: FloatArray
    position_m: float
    rotation_deg: float


def short_walk(seconds: float, fix_share: float, roll_deg: float = 0.0) -> SceneConfig:
    """A walk round a corner, in small pictures, so that many can be run."""
    return replace(
        SCENES["demo"],
        speed=((0.0, 1.2), (seconds, 1.2)),
        width=360,
        height=240,
        focal_px=310.0,
        texture_scale=0.5,
        roll_deg=roll_deg,
        gps=replace(SCENES["demo"].gps, fix_share=fix_share),
    )


def ratios(seed: int, solution: Solution, truth: Trajectory) -> Ratios:
    """Compare poses with the truth, frame by frame, in world axes."""
    e, t = match_times(solution.t_s, truth.t_s, 1e-3)
    found, true = solution.world_T_camera[e], truth.world_T_camera[t]
    position = found[:, :3, 3] - true[:, :3, 3]
    turned = Rotation.from_matrix(found[:, :3, :3] @ true[:, :3, :3].transpose(0, 2, 1))
    return Ratios(
        seed,
        position / solution.sigma_position_m[e],
        turned.as_rotvec() / solution.sigma_rotation_rad[e],
        float(np.linalg.norm(position, axis=1).mean()),
        float(np.degrees(turned.magnitude()).mean()),
    )


def settings(seed: int, given: argparse.Namespace) -> Config:
    """Of one walk."""
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
    """Simulate, smooth and compare."""
    config = settings(seed, given)
    roll_deg = float(np.random.default_rng([seed, 9]).normal(0.0, config.start.level_sigma_deg))
    with tempfile.TemporaryDirectory() as scratch:
        kept = f"walk_{given.seconds:g}_{given.fix_share:g}_{roll_deg:.2f}_{seed}"
        folder = (given.walks or Path(scratch)) / kept
        if not folder.exists():  # it appears when it is complete
            simulate(folder, short_walk(given.seconds, given.fix_share, roll_deg), seed)
        solution = vgps.smooth(vgps.open_recording(folder), config)
        start_s = read_rig(folder / "rig.yaml").video_start_s
        return ratios(seed, solution, read_trajectory(folder / "truth.tum", video_start_s=start_s))


def cells(ratio: FloatArray) -> str:
    """Mean and median of NEES, share of errors within two sigma by axis and together."""
    nees = np.mean(ratio**2, axis=1)
    inside = 100 * np.mean(np.abs(ratio) < 2, axis=0)
    by_axis = " / ".join(f"{share:.0f}" for share in inside)
    return f"{nees.mean():.2f}, {np.median(nees):.2f} | {by_axis} | {inside.mean():.0f}"


def main() -> None:
    """Print a markdown table, a row per seed and one for all."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--fix-share", type=float, default=0.2, help="RTK-fix at either end; 0.5 throughout")
    parser.add_argument("--config", type=Path)
    parser.add_argument("--fitted", action="store_true", help="regions that fit the simulated receiver")
    parser.add_argument("--walks", type=Path, help="folder that keeps the simulated walks, for a second run")
    given = parser.parse_args()
    print(
        "| seed | quantity | mean error | NEES: mean, median | % within 2 sigma, by axis | all (honest: 95) |"
    )
    print("|---" * 6 + "|")
    runs = []
    with ProcessPoolExecutor(given.jobs) as pool:
        seeds = range(given.first_seed, given.first_seed + given.seeds)
        for run in pool.map(one, seeds, [given] * given.seeds):
            runs.append(run)
            print(f"| {run.seed} | position | {run.position_m:.3f} m | {cells(run.position)} |")
            print(
                f"| {run.seed} | rotation | {run.rotation_deg:.3f} deg | {cells(run.rotation)} |", flush=True
            )
    for name, unit in (("position", "m"), ("rotation", "deg")):
        error = np.mean([getattr(run, f"{name}_{unit}") for run in runs])
        together = cells(np.concatenate([getattr(run, name) for run in runs]))
        print(f"| all | {name} | {error:.3f} {unit} | {together} |")


if __name__ == "__main__":
    main()
