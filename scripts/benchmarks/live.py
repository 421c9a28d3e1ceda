"""Is a live pose better than the fixes, and how much worse than offline?

Recorded logs run through `vgps online` as fast as it goes, where poses wait for the fits that are due, or
with ``--realtime`` as from a camera: at the video's pace, where they wait for none, so that latencies are a
user's. The error is that of each pose as it came, against the truth and unaligned. It counts from the first
pose whose stated sigma is below one metre, or within a tenth of that of the offsets of fixes. A second later
is the same pose with what came in that second, as ``vgps online --lag-s 1`` writes it. NEES is the squared
error over the stated variances, 3 if they are honest.
"""

import argparse
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.live_runs import add_delay, run_live, score, truth_of
from scripts.common.markdown import LiveTable
from vgps.evaluation import evaluate
from vgps.model import Recording

COLUMNS = {
    "log": "log",
    "seed": "seed",
    "since_s": "counts from [s]",
    "fixes_mean_m": "fixes [m]",
    "mean_m": "as it came [m]",
    "max_m": "max",
    "later_mean_m": "a second later [m]",
    "offline_mean_m": "offline [m]",
    "nees": "NEES",
    "beyond_three_sigmas": "beyond 3 sigmas",
    "rotation_deg": "rotation [degrees]",
    "rotation_nees": "its NEES",
    "returned": "after return of RTK-fix / before",
    "pose_p50_ms": "pose p50 [ms]",
    "pose_p99_ms": "p99",
}


def offline_mean_m(recording: Recording, seed: int) -> float:
    """Return the mean error of ``vgps smooth``."""
    return evaluate(
        vgps.smooth(recording, vgps.Config(seed=seed)), recording.path / "truth.tum"
    ).camera_position_m.mean


def one_run(folder: Path, gps: str, given: argparse.Namespace, seed: int) -> dict[str, str | int | float]:
    """Return the row of one log and seed.

    Raises:
        VgpsError: The recording or its truth cannot be read.
    """
    recording = vgps.open_recording(folder, gps=gps, imu=given.imu, rig=given.rig)
    run = run_live(recording, seed, given.delay_s, realtime=given.realtime)
    found = score(recording, truth_of(recording), run)
    found["offline_mean_m"] = offline_mean_m(recording, seed) if given.offline else np.nan
    imu = " with IMU" if recording.imu is not None else ""
    measures = {name: found[name] for name in list(COLUMNS)[2:]}
    return {"log": f"{folder.name} {Path(gps).stem}{imu}", "seed": seed, **measures}


def main() -> None:
    """Print a row per log and seed as it comes."""
    parser = ScriptParser("benchmarks.live", __doc__)
    parser.add_argument("recordings", type=Path, nargs="+", help="with truth")
    parser.add_argument(
        "--logs", nargs="+", help="paths, or names inside the recordings; all of their gps*.nmea if not given"
    )
    parser.add_argument("--imu", help="log of an IMU; a path, or a name inside the recordings")
    parser.add_argument("--rig", help="rig.yaml with its mounting; likewise")
    parser.add_argument("--offline", action="store_true", help="run `vgps smooth` too")
    parser.add_argument("--realtime", action="store_true", help="at the video's pace, as from a camera")
    add_delay(parser)
    add_seeds(parser, 1)
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS.values(), numbers=".3g")
        for folder in given.recordings:
            for gps in given.logs or sorted(file.name for file in folder.glob("gps*.nmea")):
                for seed in range(given.seeds):
                    found = one_run(folder, gps, given, seed)
                    results.add(**found)
                    table.add(*found.values())


if __name__ == "__main__":
    main()
