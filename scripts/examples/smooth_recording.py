"""A scripted run through the Python API, as a pattern for one's own."""

import sys
from pathlib import Path

import vgps


def main(recording: str, run: str, seed: str = "0") -> None:
    """Smooth a recording with another seed and more features, write the run, print its worst fixes."""
    config = vgps.Config(seed=int(seed))
    more = config.tracking.model_copy(update={"max_features": 500})
    solution = vgps.smooth(vgps.open_recording(recording), config.model_copy(update={"tracking": more}))
    vgps.write_run(solution, Path(run))
    if solution.fixes is not None:
        outside = [reason for reason in solution.fixes.reason if "outside its region" in reason]
        print(f"{len(outside)} of {len(solution.fixes.reason)} fixes lie outside their regions")


if __name__ == "__main__":
    main(*sys.argv[1:])
