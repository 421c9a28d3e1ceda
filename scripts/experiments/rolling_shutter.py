"""How much does a rolling shutter cost, how well is its readout found, and how much does the model help?

Simulated walks and drives with a hand that shakes, the same path seen by a global shutter and by a rolling
one: its readout given, estimated (auto), or ignored. Mean unaligned error of the camera.
"""

import statistics
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.markdown import LiveTable, mean_and_range
from scripts.common.results import Results
from scripts.common.scenes import shortened
from scripts.common.stopwatch import stopwatch
from vgps.config import RollingShutterConfig
from vgps.simulate import SCENES, simulate

Row = dict[str, Any]
SHUTTERS = ("global", "known", "estimated", "ignored")


@dataclass(frozen=True, kw_only=True)
class Case:
    """A path: its scene, frame rate and seed, the amount of shaking, its length, and the readout."""

    scene: str
    fps: int
    seed: int
    shake: float
    seconds: float
    readout_s: float

    def simulate(self, folder: Path, rolling: bool) -> vgps.Recording:
        """Return the path seen by one of the shutters."""
        scene = replace(
            shortened(SCENES[self.scene], self.seconds),
            fps=self.fps,
            hand_shake=self.shake,
            readout_s=self.readout_s if rolling else 0.0,
        )
        simulate(folder, scene, self.seed)
        return vgps.open_recording(folder)


def main() -> None:
    """Print a markdown table, a row per scene and frame rate."""
    parser = ScriptParser("experiments.rolling_shutter", __doc__)
    parser.add_argument("--scenes", nargs="+", default=["walk", "drive"], choices=list(SCENES))
    parser.add_argument("--fps", nargs="+", type=int, default=[30, 15])
    parser.add_argument("--readout-s", type=float, default=0.03)
    parser.add_argument("--hand-shake", type=float, default=1.0)
    parser.add_argument("--seconds", type=float, default=20.0, help="length of each path")
    add_seeds(parser, 3)
    given = parser.parse_args()
    shown = LiveTable(
        *("scene", "frames/s", "global, mm", "known", "estimated", "ignored", "readout, ms", "sigma, ms"),
        "CPU time, known and estimated, of global's",
    )
    with parser.refusals():
        results = parser.results(given)
        for name in given.scenes:
            for fps in given.fps:
                rows = []
                for seed in range(given.seeds):
                    case = Case(
                        scene=name,
                        fps=fps,
                        seed=seed,
                        shake=given.hand_shake,
                        seconds=given.seconds,
                        readout_s=given.readout_s,
                    )
                    rows.append({row["shutter"]: row for row in _measured(case, results)})
                shown.add(name, str(fps), *_cells(rows))


def _measured(case: Case, results: Results) -> Iterator[Row]:
    """Yield a row for each shutter and setting."""
    with tempfile.TemporaryDirectory() as scratch:
        recordings = {
            rolling: case.simulate(Path(scratch) / str(rolling), rolling) for rolling in (False, True)
        }
        for shutter in SHUTTERS:
            recording = recordings[shutter != "global"]
            if shutter in ("estimated", "ignored"):
                recording = replace(recording, camera=replace(recording.camera, readout_s=None))
            settings = RollingShutterConfig(estimate="no" if shutter == "ignored" else "auto")
            with stopwatch() as elapsed:
                solution = vgps.smooth(recording, vgps.Config(seed=case.seed, rolling_shutter=settings))
            errors = vgps.evaluate(solution, recording.path / "truth.tum").camera_position_m
            row = {
                "shutter": shutter,
                "mean_m": errors.mean,
                "max_m": errors.max,
                "found_s": solution.camera.readout_s,
                "sigma_s": solution.sensors.camera_sigma.get("readout_s"),
                "cpu_s": elapsed.cpu_s,
            }
            results.add(**vars(case), **row)
            yield row


def _cells(seeds: list[dict[str, Row]]) -> Iterator[str]:
    """Yield medians and ranges over the seeds: errors, found readouts and times."""

    def of(shutter: str, name: str, scale: float = 1.0) -> list[float]:
        values = (seed[shutter][name] for seed in seeds)
        return [scale * float(value) for value in values if value is not None]

    def cell(values: list[float], digits: int = 0) -> str:
        return mean_and_range(values, digits, statistics.median(values)) if values else "none"

    for shutter in SHUTTERS:
        yield cell(of(shutter, "mean_m", 1e3))
    yield cell(of("estimated", "found_s", 1e3), 1)
    yield cell(of("estimated", "sigma_s", 1e3), 1)
    plain = of("global", "cpu_s")
    known, estimated = (
        statistics.median(a / b for a, b in zip(of(name, "cpu_s"), plain, strict=True))
        for name in ("known", "estimated")
    )
    yield f"{known:.2f}, {estimated:.2f}"


if __name__ == "__main__":
    main()
