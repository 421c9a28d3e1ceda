"""One recording changed in ways that users' recordings differ: unaligned errors on each, as a table.

Half the frames, half the size, its later part alone, driven backwards, with light that flickers and noise,
one fix in seven: settings that suit the recording as it is alone fail here.
"""

import argparse
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product, repeat
from pathlib import Path

import cv2
import numpy as np

import vgps
from vgps.config import Config
from vgps.errors import VgpsError
from vgps.evaluation import evaluate
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray, Frame, GrayImage, IntArray, Recording
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Trajectory

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
    """With some frames alone, in that order, each as ``look`` has it; backwards in time if they are."""
    images = [look(frame.index, frame.gray) for frame in recording.video.frames()]
    t_s, log = recording.video.times_s, recording.gps
    assert log is not None
    sign = np.sign(rows[-1] - rows[0])
    video = ChangedVideo(recording.path, sign * (t_s[rows] - t_s[rows[0]]), [images[row] for row in rows])
    log = replace(log, t_s=sign * (log.t_s - t_s[rows[0]]))
    return Variant(replace(recording, video=video, gps=log.rows(np.argsort(log.t_s))), rows)


def half_size(recording: Recording, rows: IntArray) -> Variant:
    """Means of two by two pixels."""
    c, height, width = recording.camera, recording.camera.height // 2, recording.camera.width // 2

    def look(_: int, image: GrayImage) -> GrayImage:
        even = image[: 2 * height, : 2 * width]
        return np.asarray(cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA), np.uint8)

    # the middle of a pixel lies at a whole number
    cx, cy = (c.cx + 0.5) / 2 - 0.5, (c.cy + 0.5) / 2 - 0.5
    camera = replace(c, width=width, height=height, fx=c.fx / 2, fy=c.fy / 2, cx=cx, cy=cy)
    return changed(replace(recording, camera=camera), rows, look)


def flickering(recording: Recording, rows: IntArray) -> Variant:
    """Light that wanders by half, and noise of four grey values."""
    steps = np.random.default_rng(0).normal(0.0, 0.08, len(rows))
    light = np.exp(np.clip(np.cumsum(steps), -0.6, 0.4))

    def look(index: int, image: GrayImage) -> GrayImage:
        noise = np.random.default_rng((1, index)).normal(0.0, 4.0, image.shape)
        return np.asarray(np.clip(light[index] * image + noise, 0, 255), np.uint8)

    return changed(recording, rows, look)


def sparse_fixes(recording: Recording, rows: IntArray) -> Variant:
    """One fix in seven."""
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


def row_of(case: tuple[str, str, int], folder: Path) -> str:
    """A row of the table: variant, log, seed, and how it went."""
    name, log, seed = case
    recording = vgps.open_recording(folder, gps=log)
    truth = read_trajectory(folder / "truth.tum", video_start_s=recording.rig.video_start_s)
    made = VARIANTS[name](recording, np.arange(len(recording.video.times_s)))
    at_s = recording.video.times_s[made.rows]
    true = Trajectory(made.recording.video.times_s, interpolate_poses(truth.t_s, truth.world_T_camera, at_s))
    begun = f"| {name} | {log} | {seed} | "
    try:
        run = vgps.smooth(made.recording, Config(seed=seed))
    except VgpsError as error:
        return f"{begun}{error} |"
    found = evaluate(run, true)
    assert run.fixes is not None and found.nees is not None
    refused = sum(verdict in {"rejected", "down-classed"} for verdict in run.fixes.verdict)
    size, turn = found.camera_position_m, found.rotation_deg
    return (
        f"{begun}{len(run.t_s)} of {len(true.t_s)} | {size.mean:.3f} | {size.max:.3f} | {turn.mean:.2f} | "
        f"{found.nees.mean / 3:.1f} | {refused} | {run.sensors.time_offset_s:.2f} |"
    )


def main() -> None:
    """Print a markdown table, a row as it comes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--logs", nargs="+", default=["gps_fix.nmea", "gps_float.nmea"])
    parser.add_argument("--only", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    print("| variant | log | seed | frames posed | mean [m] | max [m] | rotation [deg] | NEES an axis | "
          "fixes not believed | lag [s] |\n" + "|---" * 10 + "|", flush=True)  # fmt: skip
    cases = product(given.only, given.logs, range(given.seeds))
    with ProcessPoolExecutor(given.jobs) as pool:
        for row in pool.map(row_of, cases, repeat(given.recording)):
            print(row, flush=True)


if __name__ == "__main__":
    main()
