"""How fast may a camera turn before the tracker of Matsuda 2007 loses it? Simulated, 0 to 300 deg/s.

A walk is filmed with short exposures, smoothed with its fixes and made a landmark database. Then it is walked
again while the camera swings 40 deg to and fro at a peak rate, its shutter open for the whole interval, and
tracked from a start without a pose. A frame is held if it is posed by landmarks, followed from the one
before, and right to 0.5 m; what is found again by descriptors was lost. Writes rates.md, frames.csv and
rates.png: the rate at which each variant is lost, landmarks against rate (Fig. 4) and correlation against
rate (Fig. 5).
"""

import csv
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import repeat
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from scripts.common.command import ScriptParser, add_jobs
from scripts.common.markdown import table
from scripts.common.recordings import read_truth
from scripts.experiments.matsuda.tracking_errors import (
    ABLATIONS,
    TrackingErrors,
    correlations,
    errors_of,
    rates_deg_s,
)
from vgps.config import LandmarksConfig, LocalizationConfig
from vgps.landmarks.build import build_database
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.localization import Localizer
from vgps.model import BoolArray, FloatArray, Recording
from vgps.pipeline.offline import smooth
from vgps.readers.recording import open_recording
from vgps.runtime.threads import one_blas_thread
from vgps.simulate import SCENES, GpsConfig, SceneConfig, simulate

SWING_DEG = 40.0
RIGHT_M = 0.5
LOST = 0.9  # a variant is lost at the lowest rate at which it holds less of the frames than this
LEVELS = 5  # long blurs mix in what is far around a landmark
METHODS: dict[str, dict[str, object]] = {**ABLATIONS, "graph (default)": {}}
COLOURS = ("tab:orange", "tab:red", "tab:green", "tab:purple", "tab:blue")


def scene(rate_deg_s: float, seconds: float) -> SceneConfig:
    """Return a straight walk with a camera that swings at a peak rate; at rate 0 it does not."""
    swing = np.radians(SWING_DEG) / 2
    return replace(
        SCENES["spin"],
        width=360,
        height=240,
        focal_px=310.0,
        bends=(),
        texture_scale=0.5,
        max_samples=32,
        speed=((0.0, 1.0), (seconds, 1.0)),
        spin_deg_s=rate_deg_s,
        spin_period_s=float(2 * np.pi * swing / np.radians(rate_deg_s)) if rate_deg_s else 1.0,
        gps=GpsConfig(fix_share=0.5),
    )


def make_database(folder: Path, seconds: float) -> Path:
    """Make the landmark database of a slow, sharp walk unless it is there; return its file."""
    file = folder / "survey.vgps"
    if not file.exists():
        survey = replace(scene(30.0, seconds), exposure_s=0.0025, eye_m=1.65)
        simulate(folder / "survey", survey)
        recording = open_recording(folder / "survey")
        contents = build_database(smooth(recording), recording, "all", LandmarksConfig(levels=LEVELS))
        write_database(contents, file)
    return file


@dataclass(frozen=True)
class VariantResult:
    """One variant on one recording.

    Attributes:
        errors: Errors of every frame.
        held: (F,) whether a frame was followed and right.
    """

    errors: TrackingErrors
    held: BoolArray

    @property
    def landmarks(self) -> FloatArray:
        """(F,) landmarks that agree with the pose, 0 where it is not held."""
        counts = np.array([len(frame.observations) for frame in self.errors.frames], dtype=np.float64)
        return counts * self.held


def track(recording: Recording, database: Path, changes: dict[str, object]) -> VariantResult:
    """Track every frame as it comes."""
    config = LocalizationConfig.model_validate(changes)
    truth = read_truth(recording.path)
    with one_blas_thread(), LandmarkDatabase.open(database, config.selection) as opened:
        localizer = Localizer(recording, opened, config)
        frames = [localizer.add(f.t_s, localizer.undistort(f.gray)) for f in recording.video.frames()]
    errors = errors_of(frames, truth.world_T_camera)
    followed = [frame.tracked and (i == 0 or not frame.recovered) for i, frame in enumerate(frames)]
    return VariantResult(errors, np.array(followed) & (errors.position_m < RIGHT_M))


def shares_held(found: dict[str, list[VariantResult]], begin: int) -> dict[str, list[float]]:
    """Return the share of frames held while the camera swings, by variant and rate."""
    return {name: [float(one.held[begin:].mean()) for one in series] for name, series in found.items()}


def as_markdown(rates: Sequence[float], shares: dict[str, list[float]]) -> str:
    """Return the frames held at every rate, and the rate at which a variant is lost."""
    rows = []
    for name, share in shares.items():
        lost = np.flatnonzero(np.array(share) < LOST)
        at = f"{rates[lost[0]]:.0f} deg/s" if len(lost) else "never"
        rows.append([name, *(f"{100 * x:.0f} %" for x in share), at])
    columns = [f"{rate:.0f}" for rate in rates]
    return table(["method", *columns[:-1], f"{columns[-1]} deg/s", "lost at"], rows)


def plot(
    rates: Sequence[float],
    found: dict[str, list[VariantResult]],
    frame_rate: list[FloatArray],
    blur: list[tuple[FloatArray, FloatArray]],
    begin: int,
    out: Path,
) -> None:
    """Draw frames held, landmarks (Fig. 4) and correlation (Fig. 5) against the angular rate."""
    figure = Figure(figsize=(16, 4.6), layout="constrained")
    held, landmarks, correlated = figure.subplots(1, 3)
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
    rates: Sequence[float], found: dict[str, list[VariantResult]], frame_rate: list[FloatArray], out: Path
) -> None:
    """Write a row for each recording, method and frame."""
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
    """Return the median correlation (F,) of every frame at its true pose, without and with blur."""
    truth = read_truth(recording.path)
    config = LocalizationConfig()
    with one_blas_thread(), LandmarkDatabase.open(database, config.selection) as opened:
        return correlations(recording, opened, truth.world_T_camera, slice(None))


def one_rate(
    out: Path, rate: float, seconds: float, database: Path
) -> tuple[FloatArray, tuple[FloatArray, FloatArray], dict[str, VariantResult]]:
    """Make a recording if it is missing; return its rates (F,), its correlations, and every variant on it."""
    place = out / f"rate_{rate:03.0f}"
    if not place.exists():
        simulate(place, scene(rate, seconds))
    recording = open_recording(place, with_gps=False)
    found = {name: track(recording, database, changes) for name, changes in METHODS.items()}
    return rates_deg_s(recording), at_truth(recording, database), found


def main() -> None:
    """Make the recordings that are missing, run every variant on them, print and write."""
    parser = ScriptParser("experiments.matsuda.rates", __doc__)
    parser.add_argument("--out", type=Path, required=True, help="folder for recordings and results")
    parser.add_argument("--seconds", type=float, default=6.0, help="length of a recording")
    rates = [0.0, 50.0, 100.0, 150.0, 200.0, 250.0, 300.0]
    parser.add_argument("--rates", type=float, nargs="+", default=rates, help="peak rates, deg/s")
    add_jobs(parser, "recordings", default=2)
    given = parser.parse_args()
    found: dict[str, list[VariantResult]] = {name: [] for name in METHODS}
    frame_rate, blur = [], []
    with parser.refusals(), ProcessPoolExecutor(given.jobs) as pool:
        results = parser.results(given)
        given.out.mkdir(parents=True, exist_ok=True)
        database = make_database(given.out, given.seconds)
        alike = repeat(given.out), given.rates, repeat(given.seconds), repeat(database)
        for peak, (rate, correlation, variants) in zip(given.rates, pool.map(one_rate, *alike), strict=True):
            frame_rate.append(rate)
            blur.append(correlation)
            for name, one in variants.items():
                found[name].append(one)
                print(f"{peak:.0f} deg/s, {name}: {one.held.mean():.2f} held", flush=True)
    begin = len(frame_rate[0]) // 4  # until then the camera looks straight on
    shares = shares_held(found, begin)
    for name, share in shares.items():
        for peak, held in zip(given.rates, share, strict=True):
            results.add(method=name, peak_deg_s=peak, held_percent=100 * held)
    text = as_markdown(given.rates, shares)
    (given.out / "rates.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    write_frames(given.rates, found, frame_rate, given.out / "frames.csv")
    plot(given.rates, found, frame_rate, blur, begin, given.out / "rates.png")


if __name__ == "__main__":
    main()
