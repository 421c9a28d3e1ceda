"""What do stage D's settings change, one varied at a time, on logs of a recording and on simulated streets?

Stages A to C run once per log or scene and seed, with the defaults; stage D once per setting. A seed of a
scene is a simulated street of its own, with RTK-float between RTK-fix at both ends, in pictures of half the
scene's size. A cell has the mean camera error [m] over seeds, its range, and the mean NEES (3 is honest). The
last column is the geometric mean over all runs of the error over that of the defaults, with twice its
standard error as a factor: below 1 a setting is better on the whole.

Whether estimating the balance between video and GPS beats every fixed one (about two minutes of processor
time for each of the hundred cases):

    python -m scripts.experiments.settings ../shared/data/kitti03 \\
        --logs gps_fix.nmea gps_float.nmea gps_float_b.nmea --scenes walk drive --seeds 20 --jobs 2 \\
        --vary batch.video_sigma_scale=2,4,16,32 batch.balance=estimated
"""

import argparse
import statistics
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np
import yaml
from pydantic import ValidationError

import vgps
from scripts.common.command import ScriptParser, add_jobs, add_seeds
from scripts.common.markdown import mean_and_range, table
from scripts.common.scenes import half_size, shortened
from scripts.common.stopwatch import stopwatch
from vgps.config import Config
from vgps.errors import ConfigError
from vgps.evaluation import evaluate
from vgps.model import Recording
from vgps.pipeline.front_end import run_front_end
from vgps.pipeline.offline import optimise_all
from vgps.runtime.progress import NoProgress
from vgps.simulate import SCENES, simulate

VARIED = ["gps.n=1,2,4,8", "gps.omega=0.1,0.5,2.5", "batch.video_sigma_scale=4,8,16"]
DEFAULTS = "defaults"


class Errors(NamedTuple):
    """Mean unaligned error of the camera, and its mean NEES (3 is honest)."""

    mean_m: float
    nees: float


class Case(NamedTuple):
    """A log of the recording or a scene, and a seed."""

    name: str
    seed: int


def settings(words: Sequence[str], seed: int) -> dict[str, Config]:
    """Return configurations by name: the defaults, and each value of each setting in turn.

    Raises:
        ConfigError: A setting does not exist, or cannot have such a value.
    """
    found = {DEFAULTS: Config(seed=seed)}
    for word in words:
        setting, is_set, values = word.partition("=")
        part, _, name = setting.partition(".")
        if not (part and name and is_set):
            raise ConfigError(f"--vary {word}", expected="PART.NAME=VALUE,VALUE as in gps.n=1,2,4")
        for value in values.split(","):
            try:
                override = {"seed": seed, part: {name: yaml.safe_load(value)}}
                found[f"{setting}={value}"] = Config.model_validate(override)
            except (ValidationError, yaml.YAMLError) as error:
                why = error.errors()[0]["msg"] if isinstance(error, ValidationError) else "not YAML"
                raise ConfigError(f"--vary {setting}={value}: {why}") from error
    return found


def one(case: Case, given: argparse.Namespace) -> tuple[dict[str, Errors], float]:
    """Return the errors of a case by setting, and the processor seconds that it took."""
    with tempfile.TemporaryDirectory() as scratch, stopwatch() as elapsed:
        if case.name in SCENES:
            folder = Path(scratch) / case.name
            simulate(folder, half_size(shortened(SCENES[case.name], given.seconds)), case.seed)
            recording = vgps.open_recording(folder)
        else:
            recording = vgps.open_recording(given.recording, gps=case.name or None)
        found = errors(recording, case.seed, given.vary)
    return found, elapsed.cpu_s


def errors(recording: Recording, seed: int, vary: Sequence[str]) -> dict[str, Errors]:
    """Return the errors on a recording with truth by setting."""
    front = run_front_end(recording, Config(seed=seed), NoProgress())
    found = {}
    for setting, config in settings(vary, seed).items():
        run = optimise_all(front, config)
        evaluation = evaluate(run, recording.path / "truth.tum")
        nees = evaluation.nees.mean if evaluation.nees else np.nan
        found[setting] = Errors(evaluation.camera_position_m.mean, nees)
    return found


def ratio_to_defaults(found: dict[Case, dict[str, Errors]], setting: str) -> str:
    """Return the geometric mean of the error over that of the defaults, and twice its standard error."""
    logs = np.log([row[setting].mean_m / row[DEFAULTS].mean_m for row in found.values()])
    doubt = f" (x/ {np.exp(2 * logs.std(ddof=1) / np.sqrt(len(logs))):.2f})" if len(logs) > 1 else ""
    return f"{np.exp(logs.mean()):.2f}{doubt}"


def as_markdown(found: dict[Case, dict[str, Errors]]) -> str:
    """Return mean error [m], range over seeds and mean NEES by setting and case."""
    names = list(dict.fromkeys(case.name for case in found))
    rows = []
    for setting in next(iter(found.values())):
        cells = []
        for name in names:
            means, nees = zip(
                *(row[setting] for case, row in found.items() if case.name == name), strict=True
            )
            cells.append(f"{mean_and_range(means)}, {statistics.mean(nees):.1f}")
        rows.append([setting, *cells, ratio_to_defaults(found, setting)])
    return table(["setting", *names, "to defaults"], rows)


def main() -> None:
    """Print progress, then the table."""
    parser = ScriptParser("experiments.settings", __doc__)
    parser.add_argument("recording", type=Path, nargs="?", help="with truth")
    parser.add_argument("--logs", nargs="+", default=[], help="GPS logs of the recording")
    parser.add_argument("--scenes", nargs="+", default=[], choices=list(SCENES), help="simulated scenes")
    parser.add_argument("--seconds", type=float, default=40.0, help="length of the scenes")
    add_seeds(parser, 1)
    add_jobs(parser, "cases")
    parser.add_argument(
        "--vary", nargs="+", default=VARIED, metavar="PART.NAME=VALUE,VALUE", help="settings and values"
    )
    given = parser.parse_args()
    if given.logs and given.recording is None:
        parser.error("--logs needs a recording")
    logs = given.logs or ([""] if given.recording else [])  # without a name: the recording's own
    # seeds outside, so that a run that is stopped has as many of every recording
    cases = [Case(name, seed) for seed in range(given.seeds) for name in (*logs, *given.scenes)]
    if not cases:
        parser.error("expected a recording or --scenes")
    found: dict[Case, dict[str, Errors]] = {}
    with parser.refusals():
        settings(given.vary, 0)  # refuse before the long work
        results = parser.results(given)
        with ProcessPoolExecutor(given.jobs) as pool:
            for case, (row, cpu_s) in zip(cases, pool.map(one, cases, [given] * len(cases)), strict=True):
                named = Case(case.name or "gps", case.seed)
                found[named] = row
                for setting, error in row.items():
                    results.add(recording=named.name, seed=named.seed, setting=setting, **error._asdict())
                print(f"{named.name}, seed {named.seed}: {cpu_s:.0f} s of processor time", flush=True)
    print(as_markdown(found))


if __name__ == "__main__":
    main()
