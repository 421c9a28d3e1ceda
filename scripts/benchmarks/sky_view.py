"""Does it help to enlarge the regions of fixes where landmarks hide the sky?

Stage D runs with the setting (``gps: {sky: {enlarge: true}}``) and without it on one run of stages A to C.
Simulated streets get multipath, which the simulator itself does not have: of 14 satellites, spread evenly
over the sky above 15 degrees, the signals of those behind a house or a tree of the true scene travel an
exponentially distributed excess farther, one draw per satellite, and fixes that are not RTK-fix move as least
squares on position and clock moves. A row without multipath follows: there the setting can only lose.
Pictures are half the scene's size. Growth is the radius of a region with the setting over that without.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from scripts.common.scenes import half_size, shortened
from vgps.config import Config
from vgps.evaluation import evaluate
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import BoolArray, FixClass, FloatArray, GpsLog, Recording
from vgps.pipeline.front_end import run_front_end
from vgps.pipeline.offline import optimise_all
from vgps.runtime.progress import NoProgress
from vgps.simulate import SCENES, World, build_motion, build_world, simulate
from vgps.solution import Trajectory, Verdict

SATELLITES, MASK_DEG, STEEP = 14, 15.0, 0.5


def satellites(rng: np.random.Generator) -> FloatArray:
    """Return (S, 3) directions, evenly over the sky above the mask, rotated at random about the vertical."""
    k = np.arange(SATELLITES)
    low = np.sin(np.radians(MASK_DEG))
    up = low + (1.0 - low) * (k + 0.5) / SATELLITES
    azimuth = k * np.pi * (3.0 - np.sqrt(5.0)) + rng.uniform(0.0, 2.0 * np.pi)
    flat = np.sqrt(1.0 - up**2)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), up], axis=1)


def hidden(world: World, antenna: FloatArray, directions: FloatArray) -> BoolArray:
    """Return (S,) which directions a static, upright surface hides from an antenna (3,)."""
    normal = np.cross(world.edge_u, world.edge_v)
    upright = (np.abs(normal[:, 2]) < STEEP * np.linalg.norm(normal, axis=1)) & ~world.velocity.any(axis=1)
    u, v, n = world.edge_u[upright], world.edge_v[upright], normal[upright]
    away = world.origin[upright] - antenna
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.sum(away * n, axis=1) / (directions @ n.T)
        at = reach[..., None] * directions[:, None] - away
        a, b = np.sum(at * u, axis=2) / np.sum(u * u, axis=1), np.sum(at * v, axis=2) / np.sum(v * v, axis=1)
        met = (reach > 0) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
    return np.asarray(met.any(axis=1))


def multipath(
    world: World, antennas: FloatArray, mean_excess_m: float, rng: np.random.Generator
) -> FloatArray:
    """Return (M, 3) by how much fixes at antennas (M, 3) move, east, north, up, metres."""
    directions = satellites(rng)
    excess = rng.exponential(mean_excess_m, SATELLITES)
    position_per_range = np.linalg.pinv(np.column_stack([-directions, np.ones(SATELLITES)]))[:3]
    range_error = [hidden(world, antenna, directions) * excess for antenna in antennas]
    return np.asarray(np.array(range_error) @ position_per_range.T)


def moved(log: GpsLog, recording: Recording, offset_m: FloatArray) -> GpsLog:
    """Return the log with its fixes moved by (M, 3) metres."""
    origin = recording.rig.world_origin
    assert origin is not None
    enu = to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m) + offset_m
    latitude, longitude, height = np.array(to_geodetic(origin, enu)).T
    return replace(log, latitude_deg=latitude, longitude_deg=longitude, height_m=height)


class Case(NamedTuple):
    """A recording with truth, and by how much its fixes were moved (M, 3), if they were."""

    name: str
    recording: Recording
    truth: Trajectory
    offset_m: FloatArray | None = None


def simulated(name: str, seed: int, given: argparse.Namespace) -> Iterator[Case]:
    """Yield a simulated street with multipath, and without."""
    scene = half_size(shortened(SCENES[name], given.seconds))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / name
        simulate(folder, scene, seed)
        recording, truth = vgps.open_recording(folder), read_truth(folder)
        assert recording.gps is not None
        world = build_world(scene, np.random.default_rng([seed, 1]))
        poses = build_motion(scene, np.random.default_rng([seed, 0])).poses(recording.gps.t_s)
        antennas = poses[:, :3, :3] @ np.array(scene.camera_p_antenna) + poses[:, :3, 3]
        offset_m = multipath(world, antennas, given.excess, np.random.default_rng([seed, 9]))
        offset_m[[name is FixClass.RTK_FIX for name in recording.gps.fix_class]] = 0.0
        log = moved(recording.gps, recording, offset_m)
        yield Case(f"{name}, multipath", replace(recording, gps=log), truth, offset_m)
        yield Case(name, recording, truth)


def cases(seed: int, given: argparse.Namespace) -> Iterator[Case]:
    """Yield the logs of the recording that was asked for, or the simulated scenes."""
    if given.recording:
        for log in given.logs:
            recording = vgps.open_recording(given.recording, gps=log)
            yield Case(log, recording, read_truth(given.recording))
        return
    for name in given.scenes:
        yield from simulated(name, seed, given)


def measure(case: Case, seed: int) -> dict[str, Any]:
    """Return what stage D makes of a case without the setting and with it."""
    off = Config(seed=seed)
    on = Config.model_validate({"seed": seed, "gps": {"sky": {"enlarge": True}}})
    front = run_front_end(case.recording, off, NoProgress())
    errors, rejected, radii = [], [], []
    for config in (off, on):
        run = optimise_all(front, config)
        errors.append(evaluate(run, case.truth).camera_position_m.mean)
        assert run.fixes is not None
        rejected.append(sum(verdict == Verdict.REJECTED for verdict in run.fixes.verdict))
        radii.append(run.fixes.r_m[np.isfinite(run.fixes.residual_m[:, 0])])
    growth, offset_m = radii[1] / radii[0], case.offset_m
    return {
        "recording": case.name,
        "seed": seed,
        "multipath_m": None
        if offset_m is None
        else np.linalg.norm(offset_m[offset_m.any(axis=1)], axis=1).mean(),
        "median_growth": np.median(growth),
        "largest_growth": growth.max(),
        "mean_without_m": errors[0],
        "mean_with_m": errors[1],
        "rejected_without": rejected[0],
        "rejected_with": rejected[1],
    }


def main() -> None:
    """Print a markdown table, a row as it comes."""
    parser = ScriptParser("benchmarks.sky_view", __doc__)
    parser.add_argument("--scenes", nargs="*", choices=list(SCENES), default=["walk", "drive"])
    parser.add_argument("--seconds", type=float, default=40.0, help="length of a scene")
    add_seeds(parser, 2)
    parser.add_argument("--excess", type=float, default=2.0, help="mean excess of a hidden path, m")
    parser.add_argument("--recording", type=Path, help="a recording with truth, in place of the scenes")
    parser.add_argument("--logs", nargs="+", default=["gps.nmea"], help="of the recording")
    given = parser.parse_args()
    columns = ("recording", "seed", "multipath [m]", "growth, median (largest)")
    with parser.refusals():
        results = parser.results(given)
        table = LiveTable(*columns, "mean error without [m]", "with [m]", "rejected without, with")
        for seed in range(given.seeds):
            for case in cases(seed, given):
                found = measure(case, seed)
                results.add(**found)
                multipath_m = "-" if found["multipath_m"] is None else f"{found['multipath_m']:.2f}"
                cells = (
                    f"{found['median_growth']:.2f} ({found['largest_growth']:.2f})",
                    f"{found['mean_without_m']:.3f}",
                    f"{found['mean_with_m']:.3f}",
                    f"{found['rejected_without']}, {found['rejected_with']}",
                )
                table.add(case.name, seed, multipath_m, *cells)


if __name__ == "__main__":
    main()
