"""Every GPS model on every log of a recording with truth, over several seeds: unaligned errors as a table.

python scripts/table_models.py RECORDING --logs a.nmea b.nmea [--models ...] [--seeds N] [--survey S.yaml]
"""

import argparse
import statistics
from pathlib import Path
from typing import get_args

import vgps
from vgps.config import GpsModel
from vgps.evaluate import evaluate
from vgps.readers.trajectory import read_trajectory


def main() -> None:
    """Print a markdown table; a cell has the mean error's median over seeds and its range, in metres."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--logs", nargs="+", required=True)
    parser.add_argument("--models", nargs="+", default=list(get_args(GpsModel)))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--survey", type=Path)
    given = parser.parse_args()
    truth = read_trajectory(given.recording / "truth.tum")
    print("| model | " + " | ".join(given.logs) + " |")
    print("|---" * (1 + len(given.logs)) + "|")
    for model in given.models:
        cells = []
        for log in given.logs:
            recording = vgps.open_recording(given.recording, gps=log)
            errors = []
            for seed in range(given.seeds):
                config = vgps.Config(seed=seed).with_gps(model, given.survey)
                solution = vgps.smooth(recording, config)
                found = evaluate(solution.trajectory, truth, solution.camera_p_antenna)
                errors.append(found.camera_position_m.mean)
            cells.append(f"{statistics.median(errors):.2f} ({min(errors):.2f}-{max(errors):.2f})")
        print(f"| {model} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
