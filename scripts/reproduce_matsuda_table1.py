"""Table 1 of Matsuda 2007 on a recording with truth: the proposed tracker, its three ablations, and ours.

    python scripts/reproduce_matsuda_table1.py ../shared/data/kitti03_shake --landmarks even.db --out table1

Errors are unaligned and counted on every second frame, from ``--first 1`` the odd ones: on kitti03_shake the
others show pictures of which a database of the drive's even frames was made. Writes table1.md, frames.csv
and table1.png.
"""

import argparse
import csv
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path

import matplotlib as mpl
import numpy as np

from vgps.config import TrackConfig
from vgps.evaluation.run import in_world
from vgps.geometry import project
from vgps.geometry.angular_rates import GyroIntegral
from vgps.landmarks.database import LandmarkDatabase
from vgps.localization.localizer import Localiser
from vgps.localization.matching import match_templates
from vgps.localization.prediction import Motion, exposure_motion_px
from vgps.localization.templates import render_templates
from vgps.localization.tracker import TrackedFrame
from vgps.model import FloatArray, Frame, Recording
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.threads import one_blas_thread

mpl.use("Agg")
import matplotlib.pyplot as plt

AS_TRACK = "graph (default), 120 landmarks, with the second after it"  # what vgps track writes
_ALIKE: dict[str, object] = {"max_landmarks": 160}  # for all methods
PAPER: dict[str, object] = {"estimator": "frame", "blur": "interval"}
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


@dataclass(frozen=True)
class Errors:
    """Of one method: position [m] and rotation [deg] of every frame, and whether it was tracked."""

    frames: list[TrackedFrame]
    position_m: FloatArray
    rotation_deg: FloatArray

    def row(self, name: str, counted: slice) -> str:
        """A line of the table."""
        tracked = np.array([frame.tracked for frame in self.frames])
        lost = np.flatnonzero(~tracked)
        first = str(lost[0]) if len(lost) else "never"
        good = tracked[counted]
        position, rotation = self.position_m[counted][good], self.rotation_deg[counted][good]
        return (
            f"| {name} | {position.mean():.3f} | {np.median(position):.3f} | {position.max():.2f} "
            f"| {rotation.mean():.2f} | {rotation.max():.2f} | {tracked.sum()} of {len(tracked)} | {first} |"
        )


def run(place: Path, landmarks: Path, name: str) -> list[TrackedFrame]:
    """Track every frame by one of the methods: as it comes, or for the last method as it was left."""
    recording = open_recording(place, with_gps=False)
    config = TrackConfig.model_validate(_ALIKE | METHODS[name])
    frames: dict[float, TrackedFrame] = {}
    with one_blas_thread(), LandmarkDatabase.open(landmarks, config.selection) as database:
        localiser = Localiser(recording, database, config)
        for frame in frames_of(recording):
            frames[frame.t_s] = localiser.add(frame.t_s, localiser.undistort(frame.gray))
            for t_s, pose in localiser.revised().items() if name == AS_TRACK else ():
                frames[t_s] = replace(frames[t_s], world_T_camera=pose)
    return list(frames.values())


def frames_of(recording: Recording) -> Iterator[Frame]:
    """The video's frames."""
    return iter(recording.video.frames())


def errors_of(frames: list[TrackedFrame], truth: FloatArray) -> Errors:
    """Unaligned errors against the truth (F, 4, 4); NaN where there is not even a prediction."""
    poses = np.array([frame.world_T_camera for frame in frames])
    between = poses[:, :3, :3].transpose(0, 2, 1) @ truth[:, :3, :3]
    cosine = (np.trace(between, axis1=1, axis2=2) - 1) / 2
    position = np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1)
    return Errors(frames, position, np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def correlations(
    recording: Recording, database: LandmarkDatabase, world_T_camera: FloatArray, every: slice
) -> tuple[FloatArray, FloatArray]:
    """Median correlation of each counted frame without and with blur at poses (F, 4, 4), or NaN."""
    config, camera = TrackConfig.model_validate(_ALIKE), recording.camera
    localiser = Localiser(recording, database, config)
    out = []
    wanted = set(np.arange(len(world_T_camera))[every].tolist())
    for frame in frames_of(recording):
        pose = world_T_camera[frame.index]
        if frame.index not in wanted or np.isnan(pose).any():
            continue
        views = database.views(pose, camera, max_landmarks=config.max_landmarks)
        if not len(views):
            out.append([np.nan, np.nan])
            continue
        motion = Motion(frame.t_s, pose, None, np.zeros(3), np.zeros(3))
        exposure_s = recording.rig.exposure_s or 0.0
        blur = exposure_motion_px(
            camera.K, motion, localiser.turns, frame.t_s, exposure_s, views.world_p_landmark
        )
        uv, _ = project(camera.K, pose, views.world_p_landmark)
        image, radius = localiser.undistort(frame.gray), np.full(len(views), 3.0)
        medians = []
        for motion_px in (np.zeros_like(blur), blur):
            templates = render_templates(camera.K, pose, views, motion_px, config.template_px)
            medians.append(float(np.median(match_templates(image, templates, uv, radius).correlation)))
        out.append(medians)
    without, with_blur = np.array(out).T
    return without, with_blur


def rates_deg_s(recording: Recording) -> FloatArray:
    """(F,) angular rate of the camera over each exposure."""
    assert recording.gyro is not None
    half = (recording.rig.exposure_s or 0.0) / 2 + 1e-3
    t = recording.video.times_s
    low, high = recording.gyro.t_s[0], recording.gyro.t_s[-1]
    start = np.clip(t - half, low, high - 2e-3)
    mean = GyroIntegral(recording.gyro).mean_rates(start, np.clip(t + half, low + 2e-3, high))
    return np.asarray(np.degrees(np.linalg.norm(mean, axis=1)))


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
    with LandmarkDatabase.open(given.landmarks, TrackConfig().selection) as database:
        if recording.rig.world_origin is not None and database.world_origin is not None:
            truth = in_world(truth, recording.rig.world_origin, database.world_origin)
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
