"""What hidden sky gains or loses: stage D with ``gps: {sky: {enlarge: true}}`` and without, on one run
of stages A to C.

Simulated streets get multipath, which the simulator itself does not know: of 14 satellites, spread evenly
over the sky above 15 degrees, those behind a house or a tree of the true scene come by a way that is longer,
by an exponentially distributed excess of each satellite's own, and fixes that are not RTK-fix move as least
squares on place and clock moves. Another row is without it: there the rule can only lose. Pictures are half
the scene's size. A region counts as grown by its radius with the rule over that without.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

import vgps
from scripts.common.scenes import small
from vgps.config import Config
from vgps.evaluation import evaluate
from vgps.geodesy import to_enu, to_geodetic
from vgps.model import FixClass, FloatArray, GpsLog, Recording
from vgps.pipeline.offline import optimise_all, track_and_map
from vgps.readers.calibration import read_rig
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import Silent
from vgps.simulate import SCENES, World, build_motion, build_world, simulate
from vgps.solution import Trajectory, Verdict

SATELLITES, MASK_DEG, STEEP = 14, 15.0, 0.5


def satellites(rng: np.random.Generator) -> FloatArray:
    """(S, 3) directions, evenly over the sky above the mask, turned at random."""
    k = np.arange(SATELLITES)
    low = np.sin(np.radians(MASK_DEG))
    up = low + (1.0 - low) * (k + 0.5) / SATELLITES
    turn = k * np.pi * (3.0 - np.sqrt(5.0)) + rng.uniform(0.0, 2.0 * np.pi)
    flat = np.sqrt(1.0 - up**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), up], axis=1)


def hidden(world: World, antenna: FloatArray, directions: FloatArray) -> np.ndarray:
    """(S,) whether something that stands and does not move hides a direction from (3,)."""
    normal = np.cross(world.edge_u, world.edge_v)
    stands = (np.abs(normal[:, 2]) < STEEP * np.linalg.norm(normal, axis=1)) & ~world.velocity.any(axis=1)
    u, v, n = world.edge_u[stands], world.edge_v[stands], normal[stands]
    away = world.origin[stands] - antenna
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.sum(away * n, axis=1) / (directions @ n.T)
        at = reach[..., None] * directions[:, None] - away
        a, b = np.sum(at * u, axis=2) / np.sum(u * u, axis=1), np.sum(at * v, axis=2) / np.sum(v * v, axis=1)
        met = (reach > 0) & (a >= 0) & (a <= 1) & (b >= 0) & (b <= 1)
    return np.asarray(met.any(axis=1))


def multipath(
    world: World, antennas: FloatArray, mean_excess_m: float, rng: np.random.Generator
) -> FloatArray:
    """(M, 3) how far fixes at (M, 3) move, east, north, up."""
    directions = satellites(rng)
    excess = rng.exponential(mean_excess_m, SATELLITES)
    moves = np.linalg.pinv(np.column_stack([-directions, np.ones(SATELLITES)]))[:3]
    late = [hidden(world, antenna, directions) * excess for antenna in antennas]
    return np.asarray(np.array(late) @ moves.T)


def moved(log: GpsLog, recording: Recording, offset_m: FloatArray) -> GpsLog:
    """The log with its fixes moved by (M, 3) metres."""
    origin = recording.rig.world_origin
    assert origin is not None
    enu = to_enu(origin, log.latitude_deg, log.longitude_deg, log.height_m) + offset_m
    latitude, longitude, height = np.array(to_geodetic(origin, enu)).T
    return replace(log, latitude_deg=latitude, longitude_deg=longitude, height_m=height)


def simulated(
    name: str, seed: int, given: argparse.Namespace
) -> Iterator[tuple[str, Recording, Trajectory, FloatArray | None]]:
    """A street with multipath and without: its name, recording, truth, and how far fixes moved."""
    scene = small(name, given.seconds)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / name
        simulate(folder, scene, seed)
        recording, truth = vgps.open_recording(folder), read_trajectory(folder / "truth.tum")
        assert recording.gps is not None
        world = build_world(scene, np.random.default_rng([seed, 1]))
        poses = build_motion(scene, np.random.default_rng([seed, 0])).poses(recording.gps.t_s)
        antennas = poses[:, :3, :3] @ np.array(scene.camera_p_antenna) + poses[:, :3, 3]
        offset = multipath(world, antennas, given.excess, np.random.default_rng([seed, 9]))
        offset[[name is FixClass.RTK_FIX for name in recording.gps.fix_class]] = 0.0
        yield (
            f"{name}, multipath",
            replace(recording, gps=moved(recording.gps, recording, offset)),
            truth,
            offset,
        )
        yield name, recording, truth, None


def recorded(log: str, given: argparse.Namespace) -> tuple[str, Recording, Trajectory, None]:
    """A recording with truth."""
    start_s = read_rig(given.recording / "rig.yaml").video_start_s
    truth = read_trajectory(given.recording / "truth.tum", video_start_s=start_s)
    return log, vgps.open_recording(given.recording, gps=log), truth, None


def row(name: str, recording: Recording, truth: Trajectory, offset: FloatArray | None, seed: int) -> None:
    """Print a line of the table."""
    off = Config(seed=seed)
    on = Config.model_validate({"seed": seed, "gps": {"sky": {"enlarge": True}}})
    front = track_and_map(recording, off, Silent())
    errors, refused, radii = [], [], []
    for config in (off, on):
        run = optimise_all(front.copied(), config)
        errors.append(evaluate(run, truth).camera_position_m.mean)
        assert run.fixes is not None
        refused.append(sum(verdict == Verdict.REJECTED for verdict in run.fixes.verdict))
        radii.append(run.fixes.r_m[np.isfinite(run.fixes.residual_m[:, 0])])
    grown = radii[1] / radii[0]
    path = "-" if offset is None else f"{np.linalg.norm(offset[offset.any(axis=1)], axis=1).mean():.2f}"
    print(
        f"| {name} | {seed} | {path} | {np.median(grown):.2f} ({grown.max():.2f}) | "
        f"{errors[0]:.3f} | {errors[1]:.3f} | {refused[0]}, {refused[1]} |",
        flush=True,
    )


def main() -> None:
    """Print a markdown table."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("--scenes", nargs="*", choices=list(SCENES), default=["walk", "drive"])
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--excess", type=float, default=2.0, help="mean longer way of a hidden satellite [m]")
    parser.add_argument("--recording", type=Path)
    parser.add_argument("--logs", nargs="+", default=["gps.nmea"])
    given = parser.parse_args()
    print("| recording | seed | multipath [m] | regions grow by: median (most) | without: mean error [m] | "
          "with | refused |\n" + "|---" * 7 + "|")  # fmt: skip
    for seed in range(given.seeds):
        if given.recording:
            for log in given.logs:
                row(*recorded(log, given), seed)
            continue
        for name in given.scenes:
            for one in simulated(name, seed, given):
                row(*one, seed)


if __name__ == "__main__":
    main()
