"""Does re-blurring landmark templates keep a shaken camera tracked? Table 1 of Matsuda 2007 on a recording.

The paper's tracker and its three ablations, and ours, all with the calibration that ``vgps track`` finds.
Errors are unaligned and counted on every second frame, from ``--first 1`` the odd ones: on kitti03_shake the
even ones show images of which a database of the drive's even frames was made. Writes table1.md, frames.csv
and table1.png.
"""

import csv
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from scripts.common.command import ScriptParser
from scripts.common.markdown import header, row
from scripts.common.recordings import read_truth
from scripts.experiments.matsuda.tracking_errors import (
    ABLATIONS,
    ALIKE,
    NOT_BLURRED,
    TrackingErrors,
    correlations,
    errors_of,
    rates_deg_s,
)
from vgps.config import LocalizationConfig
from vgps.evaluation.run import change_origin
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization import Localizer, localize
from vgps.localization.tracker import TrackedFrame
from vgps.model import Camera, FloatArray
from vgps.readers.recording import open_recording
from vgps.runtime.threads import one_blas_thread

COLUMNS = (
    "method",
    "position mean [m]",
    "median",
    "max",
    "rotation mean [deg]",
    "max",
    "frames held",
    "first loss",
)
AS_TRACK = "graph (default), 120 landmarks, with the second after it"  # as vgps track
DEFAULT = "graph (default), as it comes"
METHODS: dict[str, dict[str, object]] = {
    **ABLATIONS,
    "blur by the gyro over the exposure": {"estimator": "frame"},
    DEFAULT: {},
    "graph, without gyro": {"use_gyro": False},
    "graph, not blurred": {"blur": "none"},
    AS_TRACK: {"max_landmarks": 120},
}


def run(place: Path, camera: Camera, landmarks: Path, name: str) -> list[TrackedFrame]:
    """Track every frame by one of the methods, as it comes; for ``AS_TRACK`` as revised by later frames."""
    recording = replace(open_recording(place, with_gps=False), camera=camera)
    config = LocalizationConfig.model_validate(ALIKE | METHODS[name])
    frames: dict[float, TrackedFrame] = {}
    with one_blas_thread(), LandmarkDatabase.open(landmarks, config.selection) as database:
        localizer = Localizer(recording, database, config)
        for frame in recording.video.frames():
            frames[frame.t_s] = localizer.add(frame.t_s, localizer.undistort(frame.gray))
            for t_s, pose in localizer.revised().items() if name == AS_TRACK else ():
                frames[t_s] = replace(frames[t_s], world_T_camera=pose)
    return list(frames.values())


def plot(
    found: dict[str, TrackingErrors],
    rate: FloatArray,
    counted: slice,
    blur: tuple[FloatArray, FloatArray],
    out: Path,
) -> None:
    """Draw the share of frames against error, landmarks against rate, and correlation against rate."""
    figure = Figure(figsize=(16, 4.6), layout="constrained")
    shares, against, correlated = figure.subplots(1, 3)
    for name, errors in found.items():
        tracked = errors.tracked[counted]
        error = np.sort(errors.position_m[counted][tracked])
        width = 2.2 if name == DEFAULT else 1.2
        shares.plot(error, 100 * (np.arange(len(error)) + 1) / len(tracked), label=name, lw=width)
    shares.set(xlabel="unaligned position error [m], or less", ylabel="frames [%]", title="Frames held")
    shares.set(xscale="log", ylim=(0, 101))
    shares.legend(fontsize=7, loc="lower right")
    for name, colour in ((NOT_BLURRED, "tab:green"), (DEFAULT, "tab:blue")):
        count = [len(frame.observations) for frame in found[name].frames]
        against.scatter(rate, count, s=8, color=colour, label=name, alpha=0.7)
    against.set(xlabel="angular rate [deg/s]", ylabel="landmarks that agree", title="Landmarks held")
    against.legend(fontsize=8)
    tracked = found[DEFAULT].tracked[counted]
    names, colours = ("templates as stored", "re-blurred"), ("tab:green", "tab:blue")
    for values, name, colour in zip(blur, names, colours, strict=True):
        correlated.scatter(rate[counted][tracked], values, s=8, color=colour, alpha=0.7, label=name)
    correlated.set(xlabel="angular rate [deg/s]", ylabel="median correlation", title="Same poses")
    correlated.legend(fontsize=8)
    for axes in (shares, against, correlated):
        axes.grid(alpha=0.3)
    figure.savefig(out, dpi=110)


def write_frames(found: dict[str, TrackingErrors], rate: FloatArray, out: Path) -> None:
    """Write a row for each frame and method."""
    names = ["method", "frame", "tracked", "landmarks", "correlation", "rate_deg_s"]
    with out.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow([*names, "position_m", "rotation_deg"])
        for name, errors in found.items():
            for i, frame in enumerate(errors.frames):
                numbers = (frame.correlation, rate[i], errors.position_m[i], errors.rotation_deg[i])
                cells = [f"{number:.4f}" for number in numbers]
                writer.writerow([name, i, int(frame.tracked), len(frame.observations), *cells])


def cells(name: str, found: dict[str, Any]) -> list[str]:
    """Return the cells of a row of the table."""
    position = (f"{found['position_mean_m']:.3f}", f"{found['position_median_m']:.3f}")
    rotation = (f"{found['rotation_mean_deg']:.2f}", f"{found['rotation_max_deg']:.2f}")
    loss = "never" if found["first_loss"] is None else str(found["first_loss"])
    held = f"{found['held']} of {found['frames']}"
    return [name, *position, f"{found['position_max_m']:.2f}", *rotation, held, loss]


def main() -> None:
    """Run every method, print and write the table."""
    parser = ScriptParser("experiments.matsuda.table1", __doc__)
    parser.add_argument("recording", type=Path, help="with truth")
    parser.add_argument("--landmarks", type=Path, required=True, help="database of the place")
    parser.add_argument("--out", type=Path, required=True, help="folder for table, frames and picture")
    parser.add_argument("--first", type=int, default=1, help="first frame counted, then every second")
    given = parser.parse_args()
    with parser.refusals():
        results = parser.results(given)
        recording, truth = open_recording(given.recording, with_gps=False), read_truth(given.recording)
        counted = slice(given.first, None, 2)
        given.out.mkdir(parents=True, exist_ok=True)
        lines = [header(COLUMNS)]
        found: dict[str, TrackingErrors] = {}
        with LandmarkDatabase.open(given.landmarks, LocalizationConfig().selection) as database:
            if recording.rig.world_origin is not None and database.world_origin is not None:
                truth = change_origin(truth, recording.rig.world_origin, database.world_origin)
            with ProcessPoolExecutor(2) as pool:
                camera = localize(recording, database).camera  # as the landmarks show it
                places = repeat(given.recording), repeat(camera), repeat(given.landmarks)
                for name, frames in zip(METHODS, pool.map(run, *places, METHODS), strict=True):
                    found[name] = errors_of(frames, truth.world_T_camera)
                    figures = found[name].figures(counted)
                    results.add(method=name, **figures)
                    lines.append(row(cells(name, figures)))
                    print("\n".join(lines[-2:] if len(lines) == 2 else lines[-1:]), flush=True)
            posed = found[DEFAULT].frames
            poses = np.array([np.where(frame.tracked, frame.world_T_camera, np.nan) for frame in posed])
            blur = correlations(recording, database, poses, counted)
        without, with_blur = (float(np.median(values)) for values in blur)
        results.summarise(correlation_without_blur=without, correlation_with_blur=with_blur)
        lines.append(f"\nmedian correlation without and with blur: {without:.2f}, {with_blur:.2f}")
        print(lines[-1])
        (given.out / "table1.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
        rate = rates_deg_s(recording)
        write_frames(found, rate, given.out / "frames.csv")
        plot(found, rate, counted, blur, given.out / "table1.png")


if __name__ == "__main__":
    main()
