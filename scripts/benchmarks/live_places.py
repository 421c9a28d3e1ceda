"""What do places seen again do for live poses where fixes are missing?

A recording with truth runs through ``vgps online`` without fixes for a while, with and without places that
are seen again; with --back its first frames are played forward and then backward. The error is that of each
pose as it came since the fixes ended, and since half a second after the first place was seen again, also for
the run without.
"""

import argparse
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.recordings import read_truth, without_fixes
from scripts.common.stopwatch import stopwatch
from scripts.common.there_and_back import there_and_back, truth_there_and_back
from vgps.config import LoopsConfig
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray, Recording
from vgps.online import OnlineEstimate, OnlineSmoother
from vgps.online.replay import replay
from vgps.online.run import run_online

SETTLED_S = 0.5  # after a place was seen again
COLUMNS = {
    "recording": "recording",
    "seed": "seed",
    "places": "places",
    "seen_s": "seen again at [s]",
    "mean_m": "without fixes: mean [m]",
    "after_mean_m": "after it [m]",
    "after_sigma_m": "stated sigma [m]",
    "after_nees": "NEES",
    "cpu_s": "CPU [s]",
    "pose_p99_ms": "pose p99 [ms]",
}


def run_live(recording: Recording, seed: int, close: bool) -> tuple[list[OnlineEstimate], float]:
    """Return the estimates of all frames as they come, and seconds of CPU."""
    config = vgps.Config(seed=seed, loops=LoopsConfig(close="auto" if close else "no"))
    smoother = OnlineSmoother(recording.camera, recording.rig, config, imu=recording.imu)
    estimates: list[OnlineEstimate] = []
    stop = threading.Event()
    with stopwatch() as elapsed:
        run_online(replay(recording, stop), smoother, lambda one, _: estimates.append(one), stop)
    return estimates, elapsed.cpu_s


def first_place_s(estimates: list[OnlineEstimate]) -> float:
    """Return when the first place was seen again; infinite if none was."""
    seen = (event.t_s for one in estimates for event in one.events if event.kind == "place")
    return min(seen, default=np.inf)


def score(
    estimates: list[OnlineEstimate], true: FloatArray, since_s: float, seen_s: float
) -> dict[str, float]:
    """Return mean errors since the fixes ended, and since a place was seen again, NaN where there are none.

    Args:
        estimates: Of all frames.
        true: (F, 3) positions of the camera.
        since_s: End of the fixes.
        seen_s: When a place was seen again.
    """
    t_s = np.array([one.t_s for one in estimates])
    error_m = np.array([one.global_T_camera[:3, 3] for one in estimates]) - true
    sigma_m = np.array([one.sigma_position_m for one in estimates])
    known = np.isfinite(error_m[:, 0]) & np.isfinite(sigma_m[:, 0])
    without, after = known & (t_s >= since_s), known & (t_s > seen_s + SETTLED_S)
    size, stated = np.linalg.norm(error_m, axis=1), np.linalg.norm(sigma_m, axis=1)
    nees = np.sum((error_m / sigma_m) ** 2, axis=1)
    means = {"mean_m": (size, without), "after_mean_m": (size, after), "after_sigma_m": (stated, after)}
    means["after_nees"] = nees, after
    return {name: float(x[rows].mean()) if rows.any() else np.nan for name, (x, rows) in means.items()}


def case(path: Path, given: argparse.Namespace) -> tuple[Recording, FloatArray]:
    """Return a recording with an outage, and the true positions (F, 3) of its camera."""
    recording, truth = vgps.open_recording(path, gps=given.gps), read_truth(path)
    if given.back:
        recording = there_and_back(recording, recording, given.back)
        truth = truth_there_and_back(truth, recording)
    if recording.gps is not None:
        recording = replace(recording, gps=without_fixes(recording.gps, *given.no_fixes))
    times_s = np.clip(recording.video.times_s, *truth.t_s[[0, -1]])
    return recording, interpolate_poses(truth.t_s, truth.world_T_camera, times_s)[:, :3, 3]


def main() -> None:
    """Print two rows per recording and seed as they come."""
    parser = ScriptParser("benchmarks.live_places", __doc__)
    parser.add_argument("recordings", type=Path, nargs="+", help="with truth")
    parser.add_argument("--gps", help="a path, or a name inside the recordings")
    parser.add_argument("--no-fixes", nargs=2, type=float, metavar="S", required=True, help="from, to")
    parser.add_argument("--back", type=int, metavar="N", help="play N frames forward, then backward")
    add_seeds(parser, 1)
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS.values(), numbers=".3g")
        for path in given.recordings:
            recording, true = case(path, given)
            for seed in range(given.seeds):
                runs = {close: run_live(recording, seed, close) for close in (True, False)}
                seen_s = first_place_s(runs[True][0])
                for close, (estimates, cpu_s) in runs.items():
                    found = score(estimates, true, given.no_fixes[0], seen_s) | {"cpu_s": cpu_s}
                    p99_ms = 1e3 * float(np.percentile([one.seconds for one in estimates], 99))
                    head = {"recording": path.name, "seed": seed, "places": "yes" if close else "no"}
                    row = {**head, "seen_s": seen_s if close else np.nan, **found, "pose_p99_ms": p99_ms}
                    results.add(**row)
                    table.add(*row.values())


if __name__ == "__main__":
    main()
