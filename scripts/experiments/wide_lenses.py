"""Is a wide lens as good as a narrow one on the same path, from end to end?

A walk is simulated through equidistant fisheyes, with a global or a rolling shutter, and smoothed with its
calibration or without one, with RTK-fixes or by the video alone. Errors with fixes are unaligned, those of
the video alone are after a Sim(3) alignment.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from vgps.evaluation import evaluate
from vgps.simulate import SCENES, GpsConfig, simulate

WIDTH, HEIGHT = 480, 320


def film(folder: Path, degrees: float, readout_s: float, seconds: float, seed: int) -> None:
    """Simulate the walk with RTK-fixes through a fisheye of this diagonal field of view."""
    scene = replace(
        SCENES["demo"],
        speed=((0.0, 1.2), (seconds, 1.2)),
        width=WIDTH,
        height=HEIGHT,
        fisheye_deg=degrees,
        readout_s=readout_s,
        gps=GpsConfig(fix_share=0.5),
    )
    simulate(folder, scene, seed)


def row(folder: Path, calibrated: bool) -> dict[str, float | str]:
    """Smooth the recording with and without its fixes, and compare with the truth."""
    if not calibrated:
        (folder / "camera.yaml").unlink()
    recording, truth = vgps.open_recording(folder), read_truth(folder)
    fixed = vgps.smooth(recording)
    alone = vgps.smooth(replace(recording, gps=None))
    with_fixes, without = evaluate(fixed, truth), evaluate(alone, truth)
    assert without.camera_position_after_sim3_m is not None
    return {
        "fix_mean_m": with_fixes.camera_position_m.mean,
        "fix_max_m": with_fixes.camera_position_m.max,
        "alone_mean_m": without.camera_position_after_sim3_m.mean,
        "found": f"{fixed.camera.model}, fx {fixed.camera.fx:.1f}, readout {fixed.camera.readout_s}",
    }


def rows(given: argparse.Namespace) -> Iterator[dict[str, float | str]]:
    """Yield a row per lens, shutter, seed and calibration."""
    for degrees, readout_s, seed in product(given.degrees, given.readouts, range(given.seeds)):
        with tempfile.TemporaryDirectory() as scratch:
            film(Path(scratch) / "walk", degrees, readout_s, given.seconds, seed)
            for calibration in ("given", "none"):
                named = {"degrees": degrees, "readout_s": readout_s, "seed": seed, "calibration": calibration}
                yield named | row(Path(scratch) / "walk", calibration == "given")


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    add_seeds(parser, 2)
    parser.add_argument("--degrees", nargs="+", type=float, default=[80.0, 120.0, 150.0], help="lenses")
    parser.add_argument("--readouts", nargs="+", type=float, default=[0.0, 0.03], help="readouts, seconds")
    parser.add_argument("--seconds", type=float, default=12.0, help="length of a walk")
    return parser.parse_args()


def main() -> None:
    """Print a markdown table."""
    parser = ScriptParser("experiments.wide_lenses", __doc__)
    given = arguments(parser)
    table = LiveTable("lens", "readout", "seed", "calibration", "RTK-fix: mean; max", "video alone", "camera")
    with parser.refusals():
        results = parser.results(given)
        for one in rows(given):
            results.add(**one)
            table.add(
                f"{one['degrees']:.0f} deg",
                f"{1e3 * float(one['readout_s']):.0f} ms",
                str(one["seed"]),
                str(one["calibration"]),
                f"{one['fix_mean_m']:.3f}; {one['fix_max_m']:.3f} m",
                f"{one['alone_mean_m']:.4f} m",
                str(one["found"]),
            )


if __name__ == "__main__":
    main()
