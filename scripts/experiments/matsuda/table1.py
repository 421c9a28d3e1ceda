"""Table 1 of Matsuda 2007 on a recording with truth: the proposed tracker, its three ablations, and ours.

Errors are unaligned and counted on every second frame, from ``--first 1`` the odd ones: on kitti03_shake the
others show pictures of which a database of the drive's even frames was made. Writes table1.md, frames.csv and
table1.png.
"""

import argparse
import csv
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import matplotlib as mpl
import numpy as np

from scripts.experiments.matsuda.tracking_errors import (
    ALIKE,
    PAPER,
    Errors,
    correlations,
    errors_of,
    rates_deg_s,
)
from vgps.config import LocalizationConfig
from vgps.evaluation.run import change_origin
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization import Localizer
from vgps.localization.tracker import TrackedFrame
from vgps.model import FloatArray
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.threads import one_blas_thread

mpl.use("Agg")
import matplotlib.pyplot as plt

AS_TRACK = "graph (default), 120 landmarks, with the second after it"  # what vgps track writes
METHODS: dict[str, dict[str, object]] = {
    "Matsuda 2007 (A)-(E)": PAPER,
    "(1) selected by the last pose": PAPER | {"select": "last_pose"},
    "(2) templates not blurred": PAPER | {"blur": "none"},
    "(3) one window for all": PAPER | {"window": "fixed"},
    "blur by the gyro over the exposure": {"estimator": "frame"},
    "graph (default), as it comes": {},
    "graph, without gyro": {"use_gyro": False},
    "graph, not blurred": {"blur": "none"},
    AS_TRACK: {"max_landmarks": 120},
}


def run(place: Path, landmarks: Path, name: str) -> list[TrackedFrame]:
    """Track every frame by one of the methods: as it comes, or for the last method as it was left."""
    recording = open_recording(place, with_gps=False)
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
    found: dict[str, Errors], rate: FloatArray, counted: slice, blur: tuple[FloatArray, FloatArray], out: Path
) -> None:
    """Share of frames against error, landmarks against rate, correlation against rate."""
    figure, (shares, against, correlated) = plt.subplots(1, 3, figsize=(16, 4.6), layout="constrained")
    for name, errors in found.items():
        tracked = np.array([frame.tracked for frame in errors.frames])[counted]
        error = np.sort(errors.position_m[counted][tracked])
        width = 2.2 if name == "graph (default), as it comes" else 1.2
        shares.plot(error, 100 * (np.arange(len(error)) + 1) / len(tracked), label=name, lw=width)
    shares.set(
        xlabel="unaligned position error [m], or less", ylabel="frames [%]", xscale="log", ylim=(0, 101)
    )
    shares.set(title="Frames held")
    shares.legend(fontsize=7, loc="lower right")
    for name, colour in (
        ("(2) templates not blurred", "tab:green"),
        ("graph (default), as it comes", "tab:blue"),
    ):
        count = [len(frame.observations) for frame in found[name].frames]
        against.scatter(rate, count, s=8, color=colour, label=name, alpha=0.7)
    against.set(xlabel="angular rate [deg/s]", ylabel="landmarks that agree", title="Landmarks held")
    against.legend(fontsize=8)
    tracked = np.array([frame.tracked for frame in found["graph (default), as it comes"].frames])[counted]
    for values, name, colour in zip(
        blur, ("templates as stored", "re-blurred"), ("tab:green", "tab:blue"), strict=True
    ):
        correlated.scatter(rate[counted][tracked], values, s=8, color=colour, alpha=0.7, label=name)
    correlated.set(xlabel="angular rate [deg/s]", ylabel="median correlation", title="Same poses")
    correlated.legend(fontsize=8)
    for axes in (shares, against, correlated):
        axes.grid(alpha=0.3)
    figure.savefig(out, dpi=110)


def write_frames(found: dict[str, Errors], rate: FloatArray, out: Path) -> None:
    """A row for each frame and method."""
    with out.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(
            [
                "method",
                "frame",
                "tracked",
                "landmarks",
                "correlation",
                "rate_deg_s",
                "position_m",
                "rotation_deg",
            ]
        )
        for name, errors in found.items():
            for i, frame in enumerate(errors.frames):
                numbers = (frame.correlation, rate[i], errors.position_m[i], errors.rotation_deg[i])
                told = [f"{number:.4f}" for number in numbers]
                writer.writerow([name, i, int(frame.tracked), len(frame.observations), *told])


def main() -> None:
    """Run every method, print and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=Path)
    parser.add_argument("--landmarks", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--first", type=int, default=1, help="first frame counted, then every second")
    given = parser.parse_args()
    recording = open_recording(given.recording, with_gps=False)
    truth = read_trajectory(given.recording / "truth.tum", video_start_s=recording.rig.video_start_s)
    counted = slice(given.first, None, 2)
    given.out.mkdir(parents=True, exist_ok=True)
    head = (
        "| method | position mean [m] | median | max | rotation mean [deg] | max | frames held | first loss |"
    )
    lines = [head, "|" + "---|" * 8]
    found: dict[str, Errors] = {}
    with LandmarkDatabase.open(given.landmarks, LocalizationConfig().selection) as database:
        if recording.rig.world_origin is not None and database.world_origin is not None:
            truth = change_origin(truth, recording.rig.world_origin, database.world_origin)
        with ProcessPoolExecutor(2) as pool:
            places = repeat(given.recording), repeat(given.landmarks)
            for name, frames in zip(METHODS, pool.map(run, *places, METHODS), strict=True):
                found[name] = errors_of(frames, truth.world_T_camera)
                lines.append(found[name].row(name, counted))
                print(lines[-1], flush=True)
        posed = found["graph (default), as it comes"].frames
        poses = np.array([np.where(frame.tracked, frame.world_T_camera, np.nan) for frame in posed])
        blur = correlations(recording, database, poses, counted)
    lines.append(
        f"\nmedian correlation without and with blur: {np.median(blur[0]):.2f}, {np.median(blur[1]):.2f}"
    )
    print(lines[-1])
    (given.out / "table1.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    rate = rates_deg_s(recording)
    write_frames(found, rate, given.out / "frames.csv")
    plot(found, rate, counted, blur, given.out / "table1.png")


if __name__ == "__main__":
    main()
