"""How large is the error of `vgps smooth` on the logs of a recording, and on changed versions of it?

The recording as it is, at half the frames, at half the size, its later part alone, backwards, with flickering
light and noise, with one fix in seven: settings that suit the recording alone fail here. Errors of the camera
are unaligned; NEES is per axis (1 is honest).
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product, repeat
from pathlib import Path
from typing import Any

import cv2
import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_jobs, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth
from vgps.config import Config
from vgps.errors import VgpsError
from vgps.evaluation import evaluate
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray, Frame, GrayImage, IntArray, Recording
from vgps.solution import Trajectory, Verdict

Look = Callable[[int, GrayImage], GrayImage]


@dataclass(frozen=True)
class ChangedVideo:
    """Frames in memory; a :class:`vgps.model.Video`."""

    path: Path
    times_s: FloatArray
    images: list[GrayImage]

    @property
    def width(self) -> int:
        """Pixels."""
        return int(self.images[0].shape[1])

    @property
    def height(self) -> int:
        """Pixels."""
        return int(self.images[0].shape[0])

    def frames(self) -> Iterator[Frame]:
        """All of them."""
        for index, (t_s, image) in enumerate(zip(self.times_s, self.images, strict=True)):
            yield Frame(index, float(t_s), image)


@dataclass(frozen=True)
class Variant:
    """A recording, and of each of its frames the row in the one that it was made from."""

    recording: Recording
    rows: IntArray


def changed(recording: Recording, rows: IntArray, look: Look = lambda _, image: image) -> Variant:
    """Return some of the frames in that order, each changed by ``look``; time runs backwards if they do."""
    images = [look(frame.index, frame.gray) for frame in recording.video.frames()]
    t_s, log = recording.video.times_s, recording.gps
    assert log is not None
    sign = np.sign(rows[-1] - rows[0])
    video = ChangedVideo(recording.path, sign * (t_s[rows] - t_s[rows[0]]), [images[row] for row in rows])
    log = replace(log, t_s=sign * (log.t_s - t_s[rows[0]]))
    return Variant(replace(recording, video=video, gps=log.rows(np.argsort(log.t_s))), rows)


def half_size(recording: Recording, rows: IntArray) -> Variant:
    """Return the frames as means of two by two pixels."""
    c, height, width = recording.camera, recording.camera.height // 2, recording.camera.width // 2

    def look(_: int, image: GrayImage) -> GrayImage:
        even = image[: 2 * height, : 2 * width]
        return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), np.uint8)

    # pixel centres lie at whole numbers
    cx, cy = (c.cx + 0.5) / 2 - 0.5, (c.cy + 0.5) / 2 - 0.5
    camera = replace(c, width=width, height=height, fx=c.fx / 2, fy=c.fy / 2, cx=cx, cy=cy)
    return changed(replace(recording, camera=camera), rows, look)


def flickering(recording: Recording, rows: IntArray) -> Variant:
    """Return frames whose brightness wanders by half, with noise of four grey values."""
    steps = np.random.default_rng(0).normal(0.0, 0.08, len(rows))
    light = np.exp(np.clip(np.cumsum(steps), -0.6, 0.4))

    def look(index: int, image: GrayImage) -> GrayImage:
        noise = np.random.default_rng((1, index)).normal(0.0, 4.0, image.shape)
        return np.asarray(np.clip(light[index] * image + noise, 0, 255), np.uint8)

    return changed(recording, rows, look)


def sparse_fixes(recording: Recording, rows: IntArray) -> Variant:
    """Return the recording with one fix in seven."""
    assert recording.gps is not None
    log = recording.gps
    return Variant(replace(recording, gps=log.rows(np.arange(0, len(log), 7))), rows)


VARIANTS: dict[str, Callable[[Recording, IntArray], Variant]] = {
    "as it is": Variant,
    "half the frames": lambda recording, rows: changed(recording, rows[::2]),
    "half the size": half_size,
    "later part": lambda recording, rows: changed(recording, rows[3 * len(rows) // 8 :]),
    "backwards": lambda recording, rows: changed(recording, rows[::-1]),
    "flicker and noise": flickering,
    "one fix in seven": sparse_fixes,
}


def measure(case: tuple[str, str, int], folder: Path) -> dict[str, Any]:
    """Return the errors on a variant, log and seed, or why there are none."""
    name, log, seed = case
    recording, truth = vgps.open_recording(folder, gps=log), read_truth(folder)
    variant = VARIANTS[name](recording, np.arange(len(recording.video.times_s)))
    at_s = recording.video.times_s[variant.rows]
    true = Trajectory(
        variant.recording.video.times_s, interpolate_poses(truth.t_s, truth.world_T_camera, at_s)
    )
    head = {"variant": name, "log": log, "seed": seed, "frames": len(true.t_s)}
    try:
        run = vgps.smooth(variant.recording, Config(seed=seed))
    except VgpsError as error:
        return {**head, "failed": str(error)}
    found = evaluate(run, true)
    assert run.fixes is not None and found.nees is not None
    verdicts = run.fixes.verdict
    return {
        **head,
        "posed": len(run.t_s),
        "mean_m": found.camera_position_m.mean,
        "max_m": found.camera_position_m.max,
        "rotation_deg": found.rotation_deg.mean,
        "nees_per_axis": found.nees.mean / 3,
        "rejected": sum(verdict == Verdict.REJECTED for verdict in verdicts),
        "down_classed": sum(verdict == Verdict.DOWN_CLASSED for verdict in verdicts),
        "time_offset_s": run.sensors.time_offset_s,
    }


def cells(found: dict[str, Any]) -> list[str]:
    """Return the cells of a row."""
    begin = [found["variant"], found["log"], str(found["seed"])]
    if "failed" in found:
        return [*begin, found["failed"]]
    sizes = (f"{found['mean_m']:.3f}", f"{found['max_m']:.3f}", f"{found['rotation_deg']:.2f}")
    doubted = f"{found['rejected']}, {found['down_classed']}"
    nees, offset = f"{found['nees_per_axis']:.1f}", f"{found['time_offset_s']:.2f}"
    return [*begin, f"{found['posed']} of {found['frames']}", *sizes, nees, doubted, offset]


def main() -> None:
    """Print a markdown table, a row as it comes."""
    parser = ScriptParser("experiments.variants", __doc__)
    parser.add_argument("recording", type=Path, help="with truth")
    parser.add_argument("--logs", nargs="+", default=["gps_fix.nmea", "gps_float.nmea"], help="GPS logs")
    parser.add_argument("--only", nargs="+", choices=list(VARIANTS), default=list(VARIANTS), help="variants")
    add_seeds(parser, 1)
    add_jobs(parser, "runs")
    given = parser.parse_args()
    columns = ["variant", "log", "seed", "frames posed", "mean [m]", "max [m]", "rotation [deg]"]
    columns += ["NEES per axis", "fixes rejected, down-classed", "time offset [s]"]
    cases = product(given.only, given.logs, range(given.seeds))
    with parser.refusals(), ProcessPoolExecutor(given.jobs) as pool:
        results, table = parser.results(given), LiveTable(*columns)
        for found in pool.map(measure, cases, repeat(given.recording)):
            results.add(**found)
            table.add(*cells(found))


if __name__ == "__main__":
    main()
