"""Smooth a recording from Python, with settings of one's own, and count the fixes outside their regions."""

import argparse
from pathlib import Path

import vgps


def main() -> None:
    """Smooth with another seed and more features than the default, and write the run."""
    parser = argparse.ArgumentParser(prog="python -m scripts.examples.smooth_recording", description=__doc__)
    parser.add_argument("recording", help="recording folder")
    parser.add_argument("run", type=Path, help="run folder that is written")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    config = vgps.Config.model_validate({"seed": given.seed, "tracking": {"max_features": 500}})
    solution = vgps.smooth(vgps.open_recording(given.recording), config)
    vgps.write_run(solution, given.run)
    if solution.fixes is not None:
        outside = [reason for reason in solution.fixes.reason if "outside its region" in reason]
        print(f"{len(outside)} of {len(solution.fixes.reason)} fixes lie outside their regions")


if __name__ == "__main__":
    main()
