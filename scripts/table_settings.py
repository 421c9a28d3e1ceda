"""What stage D's settings change: unaligned errors with one setting varied at a time, as a table.

python scripts/table_settings.py RECORDING [--logs a.nmea ...] [--seeds N] [--vary gps.n=1,2,4 ...]

The front end runs once per log and seed, with the defaults; stage D once per setting.
"""

import argparse
import copy
import statistics
from dataclasses import replace
from pathlib import Path

import yaml

import vgps
from vgps.config import Config
from vgps.evaluate import evaluate
from vgps.offline import FrontEnd, Silent, optimise_all, track_and_map
from vgps.readers.calibration import read_rig
from vgps.readers.trajectory import read_trajectory

VARIED = ["gps.n=1,2,4,8", "gps.omega=0.1,0.5,2.5", "batch.video_sigma_scale=4,8,16"]


def settings(words: list[str], seed: int) -> dict[str, Config]:
    """Configurations by name: the defaults, and each value of each setting in turn."""
    found = {"defaults": Config(seed=seed)}
    for word in words:
        place, values = word.split("=")
        part, name = place.split(".")
        for value in values.split(","):
            override = {"seed": seed, part: {name: yaml.safe_load(value)}}
            found[f"{place}={value}"] = Config.model_validate(override)
    return found


def copied(front: FrontEnd) -> FrontEnd:
    """The same front end with maps of its own, which stage D moves."""
    sequence = copy.copy(front.sequence)
    sequence.maps = copy.deepcopy(front.sequence.maps)
    return replace(front, sequence=sequence)


def main() -> None:
    """Print a markdown table: mean camera error [m] over seeds, and the mean of its NEES (3 is honest)."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--logs", nargs="+", default=[None])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--vary", nargs="+", default=VARIED)
    given = parser.parse_args()
    start_s = read_rig(given.recording / "rig.yaml").video_start_s
    truth = read_trajectory(given.recording / "truth.tum", video_start_s=start_s)
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
