"""Table 6, Kume 2010: methods A to D, the cylinder and Cauchy on simulated walks or on a recording.

Without a recording each seed is a walk of its own, as in section 4 of the thesis: 70 m, hand-held, 720x480,
15 frames a second, RTK-fix at both ends and RTK-float between. With one, a seed is the front end's.

Twenty walks at the least cost: --seeds 20 --jobs 2 --small --methods B C D cylinder (pictures of half the
size, and without the video alone, which has stages A to C of its own).
"""

import argparse
import json
import statistics
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import yaml

import vgps
from scripts.experiments.kume_table6.table import Row, antenna_errors, as_markdown
from vgps.compare import METHODS, compare
from vgps.compare.methods import Method
from vgps.errors import VgpsError
from vgps.runtime.progress import Silent
from vgps.simulate import SceneConfig, scene_with_errors, simulate

LEAST_FRAMES = 2


def walk(given: argparse.Namespace) -> SceneConfig:
    """The thesis's walk, or its first frames, with simulated errors or those of a receiver's log."""
    scene = scene_with_errors("walk", given.gps_errors, given.gps_reference)
    if given.small:
        size = {"width": scene.width // 2, "height": scene.height // 2}
        scene = replace(scene, **size, focal_px=scene.focal_px / 2, texture_scale=0.5)
    if given.frames is not None:
        end_s = min(given.frames, scene.frames) / scene.fps
        before = tuple(knot for knot in scene.speed if knot[0] < end_s)
        scene = replace(scene, speed=(*before, (end_s, before[-1][1])))
    return scene


def miscalibrate(camera: Path, share: float) -> None:
    """Make the focal length larger by a share: the video then drifts, as one of a real camera does."""
    fields = yaml.safe_load(camera.read_text(encoding="utf-8"))
    fields.update({name: fields[name] * (1 + share) for name in ("fx", "fy")})
    camera.write_text(yaml.safe_dump(fields, sort_keys=False), encoding="utf-8")


def methods(given: argparse.Namespace) -> list[Method]:
    """Those asked for, by the first word of their names."""
    return [method for method in METHODS if method.name.split()[0] in given.methods]


def on_walk(seed: int, given: argparse.Namespace) -> tuple[int, Row, float]:
    """One simulated walk: its seed, its errors by method, and processor seconds."""
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "walk"
        simulate(folder, walk(given), seed)
        miscalibrate(folder / "camera.yaml", given.focal_error)
        config = vgps.Config(seed=seed).with_gps(None, given.survey)
        found = compare(vgps.open_recording(folder), folder / "truth.tum", config, Silent(), methods(given))
    return seed, antenna_errors(found), time.process_time() - begin


def on_recording(seed: int, given: argparse.Namespace) -> tuple[int, Row, float]:
    """One seed of the front end on a recording: the seed, the errors by method, and processor seconds."""
    begin = time.process_time()
    config = vgps.Config(seed=seed).with_gps(None, given.survey)
    truth = given.truth or given.recording / "truth.tum"
    found = compare(
        vgps.open_recording(given.recording, gps=given.gps), truth, config, Silent(), methods(given)
    )
    return seed, antenna_errors(found), time.process_time() - begin


def arguments() -> argparse.Namespace:
    """What was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--frames", type=int, help="of the walk; 1110 without it")
    parser.add_argument("--small", action="store_true", help="the walk in pictures of half its size")
    words = [method.name.split()[0] for method in METHODS]
    parser.add_argument("--methods", nargs="+", choices=words, default=words, metavar="METHOD")
    parser.add_argument("--gps-errors", type=Path, help="a log whose errors are replayed on the walk")
    parser.add_argument("--gps-reference", type=Path, help="the better log of the same drive")
    parser.add_argument(
        "--focal-error", type=float, default=0.0, help="share by which it is wrong on the walk"
    )
    parser.add_argument("--recording", type=Path)
    parser.add_argument("--truth", type=Path)
    parser.add_argument("--gps")
    parser.add_argument("--survey", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path, help="write the errors of every seed here, as they come")
    given = parser.parse_args()
    if given.frames is not None and given.frames < LEAST_FRAMES:
        parser.exit(
            2, f"reproduce_kume_table6: --frames is {given.frames}; expected at least {LEAST_FRAMES}\n"
        )
    return given


def main() -> None:
    """Print both tables as markdown."""
    given = arguments()
    try:
        print_tables(given)
    except VgpsError as error:
        print(f"reproduce_kume_table6: {error}", file=sys.stderr)
        sys.exit(2)


def print_tables(given: argparse.Namespace) -> None:
    """Every seed, and what they give together."""
    rows: dict[int, Row] = {}
    seconds = []
    with ProcessPoolExecutor(given.jobs) as pool:
        one = on_recording if given.recording else on_walk
        seeds = range(given.first_seed, given.first_seed + given.seeds)
        for seed, row, took in pool.map(one, seeds, [given] * given.seeds):
            rows[seed] = row
            seconds.append(took)
            print(f"seed {seed}: {took:.0f} s of the processor", file=sys.stderr, flush=True)
            if given.json:
                given.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    print(as_markdown(list(rows.values())))
    print(f"\n{len(rows)} seeds, {statistics.mean(seconds):.0f} s of the processor each")


if __name__ == "__main__":
    main()
