"""Do region models beat Gaussian ones as in Table 6 of Kume 2010? Methods A to D, the cylinder and Cauchy.

Without a recording each seed is a walk of its own, as in section 4 of the thesis: 70 m, hand-held, 720 x 480,
15 frames per second, RTK-fix at both ends and RTK-float between. With a recording, a seed is the front end's.
Errors are the antenna's.

Twenty walks at the least cost, in pictures of half the size and without the video alone, which has stages A
to C of its own: --seeds 20 --jobs 2 --small --methods B C D cylinder.
"""

import argparse
import statistics
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import yaml

import vgps
from scripts.common.command import ScriptParser, add_jobs, add_seeds
from scripts.common.scenes import half_size, shortened
from scripts.common.stopwatch import stopwatch
from scripts.experiments.kume_table6.table import Row, antenna_errors, as_markdown
from vgps.compare import METHODS, compare
from vgps.compare.methods import Method
from vgps.runtime.progress import NoProgress
from vgps.simulate import SceneConfig, scene_with_errors, simulate

LEAST_FRAMES = 2


def walk(given: argparse.Namespace) -> SceneConfig:
    """Return the thesis's walk or its first frames, with simulated errors or those of a receiver's log."""
    scene = scene_with_errors("walk", given.gps_errors, given.gps_reference)
    if given.small:
        scene = half_size(scene)
    return scene if given.frames is None else shortened(scene, min(given.frames, scene.frames) / scene.fps)


def miscalibrate(camera: Path, share: float) -> None:
    """Increase the focal length by a share: the video then drifts, as that of a real camera does."""
    fields = yaml.safe_load(camera.read_text(encoding="utf-8"))
    fields.update({name: fields[name] * (1 + share) for name in ("fx", "fy")})
    camera.write_text(yaml.safe_dump(fields, sort_keys=False), encoding="utf-8")


def methods(given: argparse.Namespace) -> list[Method]:
    """Return the methods asked for, by the first word of their names."""
    return [method for method in METHODS if method.name.split()[0] in given.methods]


def on_walk(seed: int, given: argparse.Namespace) -> tuple[int, Row, float]:
    """Return a simulated walk's seed, its errors by method, and processor seconds."""
    with tempfile.TemporaryDirectory() as scratch, stopwatch() as elapsed:
        folder = Path(scratch) / "walk"
        simulate(folder, walk(given), seed)
        miscalibrate(folder / "camera.yaml", given.focal_error)
        config = vgps.Config(seed=seed).with_gps(None, given.survey)
        found = compare(
            vgps.open_recording(folder), folder / "truth.tum", config, NoProgress(), methods(given)
        )
    return seed, antenna_errors(found), elapsed.cpu_s


def on_recording(seed: int, given: argparse.Namespace) -> tuple[int, Row, float]:
    """Return a seed of the front end on a recording, the errors by method, and processor seconds."""
    config = vgps.Config(seed=seed).with_gps(None, given.survey)
    truth = given.truth or given.recording / "truth.tum"
    with stopwatch() as elapsed:
        recording = vgps.open_recording(given.recording, gps=given.gps)
        found = compare(recording, truth, config, NoProgress(), methods(given))
    return seed, antenna_errors(found), elapsed.cpu_s


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    add_seeds(parser, 3)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--frames", type=int, help="of the walk; 1110 without it")
    parser.add_argument("--small", action="store_true", help="the walk in pictures of half its size")
    words = [method.name.split()[0] for method in METHODS]
    parser.add_argument(
        "--methods", nargs="+", choices=words, default=words, metavar="METHOD", help="methods"
    )
    parser.add_argument("--gps-errors", type=Path, help="a log whose errors are replayed on the walk")
    parser.add_argument("--gps-reference", type=Path, help="the better log of the same drive")
    parser.add_argument("--focal-error", type=float, default=0.0, help="its share, on the walk")
    parser.add_argument("--recording", type=Path, help="with truth, in place of the walks")
    parser.add_argument("--truth", type=Path, help="by default truth.tum of the recording")
    parser.add_argument("--gps", help="a path, or a name inside the recording")
    parser.add_argument("--survey", type=Path, help="regions of the fix classes")
    add_jobs(parser, "seeds")
    given = parser.parse_args()
    if given.frames is not None and given.frames < LEAST_FRAMES:
        parser.error(f"--frames is {given.frames}, expected at least {LEAST_FRAMES}")
    return given


def main() -> None:
    """Print both tables as markdown."""
    parser = ScriptParser("experiments.kume_table6", __doc__)
    given = arguments(parser)
    rows: list[Row] = []
    seconds = []
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    with parser.refusals(), ProcessPoolExecutor(given.jobs) as pool:
        results = parser.results(given)
        for seed, row, cpu_s in pool.map(
            on_recording if given.recording else on_walk, seeds, [given] * len(seeds)
        ):
            rows.append(row)
            seconds.append(cpu_s)
            for method, error in row.items():
                results.add(seed=seed, method=method, **error._asdict())
            print(f"seed {seed}: {cpu_s:.0f} s of processor time", file=sys.stderr, flush=True)
    print(as_markdown(rows))
    print(f"\n{len(rows)} seeds, {statistics.mean(seconds):.0f} s of processor time each")


if __name__ == "__main__":
    main()
