"""What does an IMU change? Error, tilt, consistency and time of `vgps smooth` with and without it.

Tilt is the angle between true and estimated vertical after one constant rotation of the camera for the whole
recording, which is stated: that of a truth whose camera axes differ from the video's.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_recording_and_logs, add_seeds
from scripts.common.markdown import LiveTable
from scripts.common.path_angles import tilt
from scripts.common.recordings import read_truth, without_fixes
from scripts.common.stopwatch import stopwatch
from vgps.cli.terminal import TerminalProgress
from vgps.evaluation import evaluate
from vgps.model import Recording

COLUMNS = [
    "log",
    "IMU",
    "seed",
    "mean [m]",
    "max [m]",
    "end [m]",
    "tilt [deg]",
    "rotation [deg]",
    "NEES",
    "CPU [s]",
]


def one_run(recording: Recording, seed: int) -> dict[str, float]:
    """Return the result of one run."""
    with stopwatch() as elapsed:
        solution = vgps.smooth(recording, vgps.Config(seed=seed), TerminalProgress())
    errors = evaluate(solution, recording.path / "truth.tum")
    true = read_truth(recording.path)
    last = int(np.abs(true.t_s - solution.t_s[-1]).argmin())
    angle, constant = tilt(solution, true)
    return {
        "mean_m": errors.camera_position_m.mean,
        "max_m": errors.camera_position_m.max,
        "end_m": float(np.linalg.norm(solution.world_T_camera[-1, :3, 3] - true.world_T_camera[last, :3, 3])),
        "tilt_deg": angle,
        "rotation_deg": constant,
        "nees": errors.nees.mean if errors.nees else np.nan,
        "cpu_s": elapsed.cpu_s,
    }


def main() -> None:
    """Print a row per log, with and without the IMU, as it comes."""
    parser = ScriptParser("benchmarks.imu", __doc__)
    add_recording_and_logs(parser)
    parser.add_argument("--imu", required=True, help="path, or name inside the recording")
    parser.add_argument("--rig", required=True, help="rig.yaml with imu_R_camera")
    parser.add_argument("--no-fixes", nargs=2, type=float, metavar="S", help="an outage from S to S seconds")
    add_seeds(parser, 1)
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for seed in range(given.seeds):
            for gps in given.logs:
                opened = vgps.open_recording(given.recording, gps=gps, imu=given.imu, rig=given.rig)
                if given.no_fixes and opened.gps is not None:
                    opened = replace(opened, gps=without_fixes(opened.gps, *given.no_fixes))
                for used in (False, True):
                    recording = opened if used else replace(opened, imu=None)
                    found = one_run(recording, seed)
                    results.add(log=Path(gps).stem, imu=used, seed=seed, **found)
                    table.add(Path(gps).stem, "yes" if used else "no", seed, *found.values())


if __name__ == "__main__":
    main()
