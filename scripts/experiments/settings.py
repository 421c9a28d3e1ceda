"""What stage D's settings change: unaligned errors with one setting varied at a time, as a table.

Stages A to C run once per log or scene and seed, with the defaults; stage D once per setting. A seed of a
scene is a simulated street of its own, with RTK-float between RTK-fix at both ends, in pictures of half the
scene's size. The last column is the geometric mean over all runs of the error over that of the defaults, with
twice its standard error as a factor: below 1 a setting is better on the whole.

Whether estimating the balance between video and GPS beats every fixed one:

python -m scripts.experiments.settings kitti03 --logs gps_fix.nmea gps_float.nmea gps_float_b.nmea \\
    --scenes walk drive --seeds 20 --jobs 2 --vary batch.video_sigma_scale=2,4,16,32 batch.balance=estimated

takes about two minutes of processor time for each of the hundred cases.
"""

import argparse
import statistics
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from pydantic import ValidationError

import vgps
from scripts.common.scenes import half_size, shortened
from vgps.config import Config
from vgps.errors import ConfigError, VgpsError
from vgps.evaluation import evaluate
from vgps.model import Recording
from vgps.pipeline.offline import optimise_all, track_and_map
from vgps.readers.calibration import read_rig
from vgps.readers.trajectory import read_trajectory
from vgps.runtime.progress import Silent
from vgps.simulate import SCENES, simulate

VARIED = ["gps.n=1,2,4,8", "gps.omega=0.1,0.5,2.5", "batch.video_sigma_scale=4,8,16"]
DEFAULTS = "defaults"


class Error(NamedTuple):
    """Mean unaligned error of the camera, and its mean NEES (3 is honest)."""

    mean_m: float
    nees: float


class Case(NamedTuple):
    """A log of the recording or a scene, and a seed."""

    name: str
    seed: int


def settings(words: Sequence[str], seed: int) -> dict[str, Config]:
    """Configurations by name: the defaults, and each value of each setting in turn.

    Raises:
        ConfigError: There is no such setting, or it cannot have such a value.
    """
    found = {DEFAULTS: Config(seed=seed)}
    for word in words:
        place, is_set, values = word.partition("=")
        part, _, name = place.partition(".")
        if not (part and name and is_set):
            raise ConfigError(f"--vary {word}", expected="PART.NAME=VALUE,VALUE as in gps.n=1,2,4")
        for value in values.split(","):
            try:
                override = {"seed": seed, part: {name: yaml.safe_load(value)}}
                found[f"{place}={value}"] = Config.model_validate(override)
            except (ValidationError, yaml.YAMLError) as error:
                why = error.errors()[0]["msg"] if isinstance(error, ValidationError) else "no YAML"
                raise ConfigError(f"--vary {place}={value}: {why}") from error
    return found


def one(case: Case, given: argparse.Namespace) -> tuple[dict[str, Error], float]:
    """Errors of a case by setting, and the processor seconds that it took."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as scratch:
        if case.name in SCENES:
            folder = Path(scratch) / case.name
            simulate(folder, half_size(shortened(SCENES[case.name], given.seconds)), case.seed)
            recording = vgps.open_recording(folder)
        else:
            recording = vgps.open_recording(given.recording, gps=case.name)
        return errors(recording, case.seed, given.vary), time.process_time() - begun


def errors(recording: Recording, seed: int, vary: Sequence[str]) -> dict[str, Error]:
    """Of a recording with truth, by setting."""
    start_s = read_rig(recording.path / "rig.yaml").video_start_s
    truth = read_trajectory(recording.path / "truth.tum", video_start_s=start_s)
    front = track_and_map(recording, Config(seed=seed), Silent())
    found = {}
    for setting, config in settings(vary, seed).items():
        run = optimise_all(front.copied(), config)
        evaluation = evaluate(run, truth)
        nees = evaluation.nees.mean if evaluation.nees else np.nan
        found[setting] = Error(evaluation.camera_position_m.mean, nees)
    return found


def on_the_whole(found: dict[Case, dict[str, Error]], setting: str) -> str:
    """Geometric mean of the error over that of the defaults, and twice its standard error as a factor."""
    logs = np.log([row[setting].mean_m / row[DEFAULTS].mean_m for row in found.values()])
    doubt = f" (x/ {np.exp(2 * logs.std(ddof=1) / np.sqrt(len(logs))):.2f})" if len(logs) > 1 else ""
    return f"{np.exp(logs.mean()):.2f}{doubt}"


def as_markdown(found: dict[Case, dict[str, Error]]) -> str:
    """Mean error [m], range over seeds and mean NEES by setting and case."""
    names = list(dict.fromkeys(case.name for case in found))
    lines = ["| setting | " + " | ".join(names) + " | to defaults |", "|---" * (2 + len(names)) + "|"]
    for setting in next(iter(found.values())):
        cells = []
        for name in names:
            means, nees = zip(
                *(row[setting] for case, row in found.items() if case.name == name), strict=True
            )
            spread = f" ({min(means):.3f}-{max(means):.3f})" if len(means) > 1 else ""
            cells.append(f"{statistics.mean(means):.3f}{spread}, {statistics.mean(nees):.1f}")
        lines.append(f"| {setting} | " + " | ".join(cells) + f" | {on_the_whole(found, setting)} |")
    return "\n".join(lines)


def main() -> None:
    """Print a markdown table: mean camera error [m] over seeds, and the mean of its NEES (3 is honest)."""
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("recording", type=Path, nargs="?")
    parser.add_argument("--logs", nargs="+", default=[])
    parser.add_argument("--scenes", nargs="+", default=[], choices=list(SCENES))
    parser.add_argument("--seconds", type=float, default=40.0, help="of the scenes")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--vary", nargs="+", default=VARIED)
    given = parser.parse_args()
    if given.logs and given.recording is None:
        parser.error("--logs are of a recording: name it")
    logs = given.logs or ([None] if given.recording else [])
    # seeds outside, so that a run that is stopped has as many of every recording
    cases = [Case(name, seed) for seed in range(given.seeds) for name in (*logs, *given.scenes)]
    if not cases:
        parser.error("name a recording, or --scenes")
    try:
        settings(given.vary, 0)  # before the long work
        print_table(cases, given)
    except VgpsError as error:
        parser.exit(2, f"table_settings: {error}\n")


def print_table(cases: Sequence[Case], given: argparse.Namespace) -> None:
    """Every case, and what they give together."""
    found: dict[Case, dict[str, Error]] = {}
    with ProcessPoolExecutor(given.jobs) as pool:
        for case, (row, took_s) in zip(cases, pool.map(one, cases, [given] * len(cases)), strict=True):
            found[Case(case.name or "gps", case.seed)] = row
            print(f"{case.name or 'gps'}, seed {case.seed}: {took_s:.0f} s of the processor", flush=True)
    print(as_markdown(found))


if __name__ == "__main__":
    main()
