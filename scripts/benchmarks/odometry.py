"""How far does the video drift without GPS, and how long does it take beside the least that it could?

For each recording and seed, of the camera's centre: root mean square error after a similarity (Sim(3)) and
after a rigid motion (SE(3)); a run without GPS has no metre, so its first 20 m are scaled to the truth. Drift
per 100 m is the root mean square change of scale, and of the rotation's error, over all pieces of that
length, or of half the path. The floor is decoding the video and one forward pass of Lucas-Kanade over it;
times are those of the wall and, in brackets, of the processor.

With --camera-height every seed runs a second time, with that height in metres: its scale is its own. With
--colmap N (needs pycolmap; minutes) COLMAP maps every N-th frame without priors.
"""

import argparse
import statistics
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.drives import Drive, open_drive
from scripts.common.markdown import LiveTable
from scripts.common.results import Results
from scripts.common.stopwatch import stopwatch
from scripts.common.video_alone import Drift, drift_of, least_time
from vgps.cli.terminal import TerminalProgress
from vgps.config import CameraHeightConfig
from vgps.geometry import interpolate_poses
from vgps.solution import Trajectory

COLUMNS = ("recording", "by", "Sim(3) [m]", "SE(3) [m]", "scale drift [%/100 m]", "rotation [deg/100 m]")
TIMES = ("time [s]", "floor [s]", "ratio")


@dataclass(frozen=True)
class Report:
    """Where rows go: the results file and the table."""

    results: Results
    table: LiveTable

    def add(self, drive: Drive, by: str, found: dict[str, Any]) -> None:
        """Add a row."""
        self.results.add(recording=drive.name, by=by, **found)
        figures = [f"{found['sim3_m']:.3f}", f"{found['se3_m']:.3f}", f"{100 * found['scale_drift']:.2f}"]
        times = [f"{found['wall_s']:.1f} ({found['cpu_s']:.1f})"]
        if "floor_wall_s" in found:
            times += [f"{found['floor_wall_s']:.1f} ({found['floor_cpu_s']:.1f})"]
            times += [f"{found['wall_ratio']:.2f} ({found['cpu_ratio']:.2f})"]
        self.table.add(drive.name, by, *figures, f"{found['rotation_drift_deg']:.2f}", *times)


def main() -> None:
    """Print a row per seed as it comes, and medians."""
    parser = ScriptParser("benchmarks.odometry", __doc__)
    given = arguments(parser)
    with parser.refusals(), TemporaryDirectory() as scratch:
        report = Report(parser.results(given), LiveTable(*COLUMNS, *TIMES))
        drives = [open_drive(name, given.data, given.scenes or Path(scratch)) for name in given.recordings]
        for drive in drives:
            errors = [one.sim3_m for one in of_drive(drive, given, report)]
            found = {"median_m": statistics.median(errors), "worst_m": max(errors)}
            report.results.summarise(**{drive.name: found})
            print(
                f"\n{drive.name}: Sim(3) median {found['median_m']:.3f} m, worst {found['worst_m']:.3f} m\n"
            )


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument(
        "recordings",
        nargs="+",
        help="folders with truth, or scenes of the simulator; NAME:FIRST-LAST for a piece",
    )
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the recordings")
    parser.add_argument("--scenes", type=Path, help="keep simulated recordings here")
    parser.add_argument("--colmap", type=int, metavar="N", help="let COLMAP map every N-th frame")
    parser.add_argument("--camera-height", type=float, metavar="M", help="above the ground, metres")
    add_seeds(parser, 5)
    return parser.parse_args()


def of_drive(drive: Drive, given: argparse.Namespace, report: Report) -> list[Drift]:
    """Add the rows of a recording; return the drift of every seed, without a camera height."""
    drifts = []
    for seed in range(given.seeds):
        config = vgps.Config(seed=seed)
        drifts.append(one_run(drive, config, f"seed {seed}", report))
        if given.camera_height:
            height = CameraHeightConfig(m=given.camera_height)
            one_run(
                drive, config.model_copy(update={"camera_height": height}), f"seed {seed}, height", report
            )
    if given.colmap:
        by_colmap(drive, given.colmap, report)
    return drifts


def one_run(drive: Drive, config: vgps.Config, by: str, report: Report) -> Drift:
    """Add the row of a run, and return its drift."""
    floor = least_time(drive.recording.video, config.tracking)
    with stopwatch() as elapsed:
        solution = vgps.smooth(drive.recording, config, TerminalProgress())
    path, height = Trajectory(solution.t_s, solution.world_T_camera), solution.sensors.camera_height
    drift = against_truth(drive, path, is_metric=bool(height))
    times = {"wall_s": elapsed.wall_s, "cpu_s": elapsed.cpu_s}
    times |= {"floor_wall_s": floor.wall_s, "floor_cpu_s": floor.cpu_s}
    times |= {"wall_ratio": elapsed.wall_s / floor.wall_s, "cpu_ratio": elapsed.cpu_s / floor.cpu_s}
    found = figures(drift, path) | times | {"focal_px": solution.camera.fx, "stages_s": solution.seconds}
    if height:
        found |= {"scale": drift.scale, "stated_scale_sigma": height["scale_sigma"]}
    report.add(drive, by, found)
    return drift


def by_colmap(drive: Drive, every: int, report: Report) -> None:
    """Add the row of COLMAP on every n-th frame."""
    import pycolmap  # noqa: PLC0415  (an extra)

    from scripts.common.colmap_peer import map_images  # noqa: PLC0415

    pycolmap.logging.minloglevel = 1  # warnings
    with stopwatch() as elapsed:
        path, stages_s = map_images(drive.recording, every, None, None, seed=0)
    if len(path) < 3:
        print(f"COLMAP posed {len(path)} frames of {drive.name}")
        return
    posed = {"posed": len(path), "frames": len(drive.recording.video.times_s[::every])}
    times = {"wall_s": elapsed.wall_s, "cpu_s": elapsed.cpu_s, "stages_s": stages_s}
    found = figures(against_truth(drive, path), path)
    report.add(drive, f"COLMAP, every {every}", found | posed | times)


def against_truth(drive: Drive, path: Trajectory, is_metric: bool = False) -> Drift:
    """Return the drift of a path; the start of the truth gives its scale unless it is metric."""
    truth = drive.truth
    inside = (path.t_s >= truth.t_s[0] - 1e-6) & (path.t_s <= truth.t_s[-1] + 1e-6)
    true = interpolate_poses(truth.t_s, truth.world_T_camera, path.t_s[inside])
    return drift_of(path.world_T_camera[inside], true, is_metric=is_metric)


def figures(drift: Drift, path: Trajectory) -> dict[str, Any]:
    """Return what a row of the results holds of a drift; scales are relative to their median."""
    pieces = drift.pieces
    middle_s = 0.5 * (path.t_s[pieces.ends[1:]] + path.t_s[pieces.ends[:-1]])
    whole = {name: value for name, value in vars(drift).items() if name not in ("pieces", "scale")}
    return {**whole, "piece_t_s": middle_s, "piece_scale": pieces.scale / np.median(pieces.scale)}


if __name__ == "__main__":
    main()
