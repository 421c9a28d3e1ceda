"""Every GPS model on every log of a recording with truth, over several seeds: unaligned errors as a table."""

import argparse
import statistics
from pathlib import Path

import vgps
from vgps.cli.terminal import TerminalProgress
from vgps.compare import METHODS, compare


def cell(errors: list[float]) -> str:
    """Median and range, metres."""
    if len(errors) == 1:
        return f"{errors[0]:.3f}"
    return f"{statistics.median(errors):.3f} ({min(errors):.3f}-{max(errors):.3f})"


def main() -> None:
    """Print a markdown table; a cell has the mean camera error's median over seeds and its range."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--logs", nargs="+", required=True)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--survey", type=Path)
    given = parser.parse_args()
    errors: dict[tuple[str, str], list[float]] = {}
    for log in given.logs:
        recording = vgps.open_recording(given.recording, gps=log)
        for seed in range(given.seeds):
            config = vgps.Config(seed=seed).with_gps(None, given.survey)
            found = compare(recording, given.recording / "truth.tum", config, TerminalProgress())
            for name, evaluation in found.evaluations.items():
                errors.setdefault((name, log), []).append(evaluation.camera_position_m.mean)
    print("| model | " + " | ".join(given.logs) + " |")
    print("|---" * (1 + len(given.logs)) + "|")
    for method in METHODS:
        print(f"| {method.name} | " + " | ".join(cell(errors[method.name, log]) for log in given.logs) + " |")


if __name__ == "__main__":
    main()
