"""StageTimer per stage and frames per second of the whole program on a recording, against real time."""

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def one_run(recording: str, gps: str | None, out: Path) -> tuple[float, dict[str, float], int]:
    """Wall seconds of the process, seconds per stage, frames."""
    words = [sys.executable, "-m", "vgps", "smooth", recording, "--out", str(out)]
    begun = time.perf_counter()
    subprocess.run([*words, "--gps", gps] if gps else words, check=True, stdout=subprocess.DEVNULL)
    wall = time.perf_counter() - begun
    summary = json.loads((out / "solution.json").read_text())
    return wall, summary["seconds"], summary["counts"]["frames"]


def main() -> None:
    """Print the medians."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording")
    parser.add_argument("--gps")
    parser.add_argument("--runs", type=int, default=3)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        runs = [one_run(given.recording, given.gps, Path(folder) / "run") for _ in range(given.runs)]
        last = [float(line.split()[0]) for line in (Path(folder) / "run/poses.tum").open() if line[0] != "#"]
    wall, frames = statistics.median(run[0] for run in runs), runs[0][2]
    for stage in runs[0][1]:
        print(f"{stage:10s} {statistics.median(run[1].get(stage, 0.0) for run in runs):8.2f} s")
    print(f"{'process':10s} {wall:8.2f} s   {frames / wall:.1f} frames/s, {last[-1] / wall:.2f} x real time")


if __name__ == "__main__":
    main()
