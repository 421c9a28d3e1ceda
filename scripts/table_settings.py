"""What stage D's settings change: unaligned errors with one setting varied at a time, as a table.

python scripts/table_settings.py RECORDING [--logs a.nmea ...] [--seeds N] [--vary gps.n=1,2,4 ...]

The front end runs once per log and seed, with the defaults; stage D once per setting.
"""

import argparse
import statistics
from pathlib import Path

import yaml
from pydantic import ValidationError

import vgps
from vgps.compare.methods import copied
from vgps.config import Config
from vgps.errors import ConfigError, VgpsError
from vgps.evaluate import evaluate
from vgps.offline import Silent, optimise_all, track_and_map
from vgps.readers.calibration import rig_beside
from vgps.readers.trajectory import read_trajectory

VARIED = ["gps.n=1,2,4,8", "gps.omega=0.1,0.5,2.5", "batch.video_sigma_scale=4,8,16"]


def settings(words: list[str], seed: int) -> dict[str, Config]:
    """Configurations by name: the defaults, and each value of each setting in turn.

    Raises:
        ConfigError: There is no such setting, or it cannot have such a value.
    """
    found = {"defaults": Config(seed=seed)}
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


def main() -> None:
    """Print a markdown table: mean camera error [m] over seeds, and the mean of its NEES (3 is honest)."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--logs", nargs="+", default=[None])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--vary", nargs="+", default=VARIED)
    given = parser.parse_args()
    try:
        print_table(given)
    except VgpsError as error:
        parser.exit(2, f"table_settings: {error}\n")


def print_table(given: argparse.Namespace) -> None:
    """The front end for each log and seed, stage D for each setting."""
    settings(given.vary, 0)  # before the long work
    file = given.recording / "truth.tum"
    truth = read_trajectory(file, video_start_s=rig_beside(file).video_start_s)
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    logs = [str(log or "gps") for log in given.logs]
    for log, name in zip(given.logs, logs, strict=True):
        for seed in range(given.seeds):
            front = track_and_map(vgps.open_recording(given.recording, gps=log), Config(seed=seed), Silent())
            for setting, config in settings(given.vary, seed).items():
                run = optimise_all(copied(front), config)
                sigma = run.sigma_position_m
                errors = evaluate(run.trajectory, truth, run.camera_p_antenna, sigma_position_m=sigma)
                nees = errors.nees.mean if errors.nees else float("nan")
                found.setdefault((setting, name), []).append((errors.camera_position_m.mean, nees))
    print(f"| {given.recording.name} | " + " | ".join(logs) + " |\n" + "|---" * (1 + len(logs)) + "|")
    for setting in settings(given.vary, 0):
        cells = []
        for name in logs:
            means, nees = zip(*found[setting, name], strict=True)
            spread = f" ({min(means):.3f}-{max(means):.3f})" if len(means) > 1 else ""
            cells.append(f"{statistics.mean(means):.3f}{spread}, {statistics.mean(nees):.1f}")
        print(f"| {setting} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
