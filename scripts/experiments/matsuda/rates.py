"""How fast a camera may turn before the tracker of Matsuda 2007 loses it: simulated, 0 to 300 deg/s.

A walk is filmed with short exposures, smoothed with its fixes and made a landmark database. Then it is walked
again while the camera swings 40 deg to and fro at a peak rate, its shutter open for the whole interval, and
tracked from a start without a pose. Held is a frame that is posed by landmarks, followed from the one before
and right to 0.5 m; what is found again by descriptors was lost. Writes rates.md, frames.csv and rates.png:
the rate at which each variant is lost, landmarks against rate (Fig. 4) and correlation against rate (Fig. 5).
"""

import argparse
import csv
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path

import matplotlib as mpl
import numpy as np

from scripts.experiments.matsuda.tracking_errors import (
    PAPER,
    Errors,
    correlations,
    errors_of,
    rates_deg_s,
)
from vgps.config import LandmarksConfig, LocalizationConfig
from vgps.landmarks.build import build_database
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.localization import Localizer
from vgps.model import FloatArray, Recording
from vgps.pipeline.offline import smooth
from vgps.readers.recording import open_recording
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.threads import one_blas_thread
from vgps.simulate import SCENES, GpsConfig, SceneConfig, simulate

mpl.use("Agg")
import matplotlib.pyplot as plt

SWING_DEG = 40.0
RIGHT_M = 0.5
LOST = 0.9  # a variant is lost at the lowest rate at which it holds less of the frames than this
LEVELS = 5  # long blurs mix in what is far around a landmark
METHODS: dict[str, dict[str, object]] = {
    "Matsuda 2007 (A)-(E)": PAPER,
    "(1) selected by the last pose": PAPER | {"select": "last_pose"},
    "(2) templates not blurred": PAPER | {"blur": "none"},
    "(3) one window for all": PAPER | {"window": "fixed"},
    "graph (default)": {},
}
COLOURS = ("tab:orange", "tab:red", "tab:green", "tab:purple", "tab:blue")


def scene(rate_deg_s: float, seconds: float) -> SceneConfig:
    """A walk straight on with a camera that swings at a peak rate, or the survey of it at rate 0."""
    swing = np.radians(SWING_DEG) / 2
    return replace(
        SCENES["spin"],
        **{
            "width": 360,
            "height": 240,
            "focal_px": 310.0,
            "turns": (),
            "texture_scale": 0.5,
            "max_samples": 32,
        },
        speed=((0.0, 1.0), (seconds, 1.0)),
        spin_deg_s=rate_deg_s,
        spin_period_s=float(2 * np.pi * swing / np.radians(rate_deg_s)) if rate_deg_s else 1.0,
        gps=GpsConfig(fix_share=0.5),
    )


def make_database(folder: Path, seconds: float) -> Path:
    """The landmark database of a slow, sharp walk, unless it has been made."""
    place = folder / "survey.vgps"
    if not place.exists():
        survey = replace(scene(30.0, seconds), exposure_s=0.0025, eye_m=1.65)
        simulate(folder / "survey", survey)
        recording = open_recording(folder / "survey")
        contents = build_database(smooth(recording), recording, "all", LandmarksConfig(levels=LEVELS))
        write_database(contents, place)
    return place


@dataclass(frozen=True)
class Series:
    """One variant on one recording.

    Attributes:
        errors: Of every frame.
        held: (F,) followed and right.
    """

    errors: Errors
    held: np.ndarray

    @property
    def landmarks(self) -> FloatArray:
        """(F,) that agree with the pose, 0 where it is not held."""
        return np.array([len(frame.observations) for frame in self.errors.frames]) * self.held


def track(recording: Recording, database: Path, changes: dict[str, object]) -> Series:
    """Every frame as it comes."""
    config = LocalizationConfig.model_validate(changes)
    truth = read_trajectory(recording.path / "truth.tum", video_start_s=recording.rig.video_start_s)
    with one_blas_thread(), LandmarkDatabase.open(database, config.selection) as opened:
        localizer = Localizer(recording, opened, config)
        frames = [localizer.add(f.t_s, localizer.undistort(f.gray)) for f in recording.video.frames()]
    errors = errors_of(frames, truth.world_T_camera)
    followed = [frame.tracked and (i == 0 or not frame.recovered) for i, frame in enumerate(frames)]
    return Series(errors, np.array(followed) & (errors.position_m < RIGHT_M))


def table(rates: Sequence[float], found: dict[str, list[Series]], begin: int) -> str:
    """Frames held at every rate while the camera swings, and the rate at which a variant is lost."""
    head = "| method | " + " | ".join(f"{rate:.0f}" for rate in rates) + " deg/s | lost at |"
    lines = [head, "|" + "---|" * (len(rates) + 2)]
    for name, series in found.items():
        share = np.array([one.held[begin:].mean() for one in series])
        lost = np.flatnonzero(share < LOST)
        at = f"{rates[lost[0]]:.0f} deg/s" if len(lost) else "never"
        lines.append(f"| {name} | " + " | ".join(f"{100 * x:.0f} %" for x in share) + f" | {at} |")
    return "\n".join(lines)


def plot(
    rates: Sequence[float],
    found: dict[str, list[Series]],
    frame_rate: list[FloatArray],
    blur: list[tuple[FloatArray, FloatArray]],
    begin: int,
    out: Path,
) -> None:
    """Frames held, landmarks (Fig. 4) and correlation (Fig. 5), each against the angular rate."""
    figure, (held, landmarks, correlated) = plt.subplots(1, 3, figsize=(16, 4.6), layout="constrained")
    edges = np.arange(0, max(rates) + 50, 50.0)
    every = np.concatenate([rate[begin:] for rate in frame_rate])
    for (name, series), colour in zip(found.items(), COLOURS, strict=True):
        share = [100 * one.held[begin:].mean() for one in series]
        held.plot(rates, share, "o-", color=colour, label=name)
        count = np.concatenate([one.landmarks[begin:] for one in series])
        bins = np.digitize(every, edges)
        middles = [(every[bins == b].mean(), count[bins == b].mean()) for b in np.unique(bins)]
        landmarks.plot(*np.array(middles).T, "o-", color=colour, label=name)
    held.set(xlabel="peak rate of the recording [deg/s]", ylabel="frames held [%]", ylim=(-2, 102))
    held.set_title("Frames held")
    landmarks.set(xlabel="angular rate of the frame [deg/s]", ylabel="landmarks that agree, mean")
    landmarks.set_title("Landmarks per frame, 0 where lost (Fig. 4)")
    for which, name, colour in ((0, "templates as stored", "tab:green"), (1, "re-blurred", "tab:blue")):
        values = np.concatenate([pair[which][begin:] for pair in blur])
        correlated.scatter(every, values, s=7, alpha=0.6, color=colour, label=name)
    correlated.set(xlabel="angular rate of the frame [deg/s]", ylabel="median correlation", ylim=(0, 1))
    correlated.set_title("At the true poses (Fig. 5)")
    for axes in (held, landmarks, correlated):
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(out, dpi=110)


def write_frames(
    rates: Sequence[float], found: dict[str, list[Series]], frame_rate: list[FloatArray], out: Path
) -> None:
    """A row for each recording, method and frame."""
    with out.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["peak_deg_s", "method", "frame", "rate_deg_s", "held", "landmarks", "position_m"])
        for name, series in found.items():
            for peak, rate, one in zip(rates, frame_rate, series, strict=True):
                for i, held in enumerate(one.held):
                    numbers = (
                        f"{rate[i]:.1f}",
                        int(held),
                        one.landmarks[i],
                        f"{one.errors.position_m[i]:.4f}",
                    )
                    writer.writerow([peak, name, i, *numbers])


def at_truth(recording: Recording, database: Path) -> tuple[FloatArray, FloatArray]:
    """Median correlation (F,) of every frame at its true pose, without and with blur."""
    truth = read_trajectory(recording.path / "truth.tum", video_start_s=recording.rig.video_start_s)
    config = LocalizationConfig()
    with one_blas_thread(), LandmarkDatabase.open(database, config.selection) as opened:
        return correlations(recording, opened, truth.world_T_camera, slice(None))


def one_rate(
    out: Path, rate: float, seconds: float, database: Path
) -> tuple[FloatArray, tuple[FloatArray, FloatArray], dict[str, Series]]:
    """Angular rates (F,) of a recording, made if it is missing, its correlations, and every variant on it."""
    place = out / f"rate_{rate:03.0f}"
    if not place.exists():
        simulate(place, scene(rate, seconds))
    recording = open_recording(place, with_gps=False)
    found = {name: track(recording, database, changes) for name, changes in METHODS.items()}
    return rates_deg_s(recording), at_truth(recording, database), found


def main() -> None:
    """Make the recordings that are missing, run every variant on them, print and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--rates", type=float, nargs="+", default=[0, 50, 100, 150, 200, 250, 300])
    parser.add_argument("--jobs", type=int, default=2, help="recordings at the same time")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    database = make_database(given.out, given.seconds)
    found: dict[str, list[Series]] = {name: [] for name in METHODS}
    frame_rate, blur = [], []
    with ProcessPoolExecutor(given.jobs) as pool:
        alike = repeat(given.out), given.rates, repeat(given.seconds), repeat(database)
        for peak, (rate, correlation, variants) in zip(given.rates, pool.map(one_rate, *alike), strict=True):
            frame_rate.append(rate)
            blur.append(correlation)
            for name, one in variants.items():
                found[name].append(one)
                print(f"{peak:.0f} deg/s, {name}: {one.held.mean():.2f} held", flush=True)
    begin = len(frame_rate[0]) // 4  # until then the camera looks straight on
    (given.out / "rates.md").write_text(table(given.rates, found, begin) + "\n", encoding="utf-8")
    print(table(given.rates, found, begin))
    write_frames(given.rates, found, frame_rate, given.out / "frames.csv")
    plot(given.rates, found, frame_rate, blur, begin, given.out / "rates.png")


if __name__ == "__main__":
    main()
