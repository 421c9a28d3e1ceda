"""What do live poses lose by a lever arm that nobody measured?

The errors of real receivers are replayed at an antenna whose place in the camera the seed draws: up to a
metre ahead or behind, 0.6 m to either side, from a metre above to 0.3 m below. `vgps online` runs with that
lever arm, and without one. Errors and NEES (3 is right) are those of poses as they came in the second half of
the video, unaligned; beyond three of their standard deviations are poses of all of it.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from scripts.common.command import ScriptParser, add_seeds
from scripts.common.drives import Drive, open_drive
from scripts.common.live_runs import SIGMAS, mean_nees, position_errors, run_live
from scripts.common.markdown import LiveTable
from scripts.common.replayed_errors import REPLAYED, make_errors
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray, Recording

RECORDINGS = ("walk", "drive", "drone", "orbit", "kitti07")
SOURCES = ("survey_fix", "septentrio")
_NEAREST_M, _FARTHEST_M = (-0.6, -1.0, -1.0), (0.6, 0.3, 1.0)  # right, down, forward
MEASURES = ("mean_m", "sigma_m", "nees", "beyond")


def with_antenna(drive: Drive, seed: int) -> Drive:
    """Return a drive whose antenna is somewhere else."""
    place = np.random.default_rng(seed).uniform(_NEAREST_M, _FARTHEST_M)
    rig = replace(drive.recording.rig, camera_p_antenna=place)
    return replace(drive, recording=replace(drive.recording, rig=rig))


def without_antenna(recording: Recording) -> Recording:
    """Return a recording whose rig does not say where the antenna is."""
    return replace(recording, rig=replace(recording.rig, camera_p_antenna=np.zeros(3), antenna_known=False))


def live_row(recording: Recording, true: FloatArray, seed: int) -> dict[str, float]:
    """Run a recording live; return the ``MEASURES`` of its poses as they came.

    Args:
        recording: With fixes.
        true: (F, 3) the camera at its frames.
        seed: Of the run.
    """
    estimates = run_live(recording, seed).estimates
    error_m, sigma_m = position_errors(estimates, true)
    size, stated = np.linalg.norm(error_m, axis=1), np.linalg.norm(sigma_m, axis=1)
    posed = np.isfinite(size)
    late = posed & (np.arange(len(size)) >= len(size) // 2)
    if not late.any():
        return dict.fromkeys(MEASURES, np.nan)
    return {
        "mean_m": float(size[late].mean()),
        "sigma_m": float(stated[late].mean()),
        "nees": mean_nees(error_m[late], sigma_m[late]),
        "beyond": float(np.mean(size[posed] > SIGMAS * stated[posed])),
    }


def rows(given: argparse.Namespace, scratch: Path) -> Iterator[dict[str, Any]]:
    """Yield a row for each recording, receiver, clock and seed."""
    for name, source, late_s in product(given.recordings, given.sources, given.late):
        for seed in range(given.seeds):
            drive = with_antenna(open_drive(name, given.data, scratch), seed)
            log = make_errors(source, drive, given.data, seed).log
            log = replace(log, t_s=log.t_s + late_s)
            known = replace(drive.recording, gps=log.rows(log.t_s <= drive.duration_s))
            true = interpolate_poses(
                drive.truth.t_s, drive.truth.world_T_camera, drive.recording.video.times_s
            )
            found = {"recording": name, "source": source, "late_s": late_s, "seed": seed}
            for rig, recording in (("known", known), ("unknown", without_antenna(known))):
                measured = live_row(recording, true[:, :3, 3], seed)
                found |= {f"{rig}_{key}": value for key, value in measured.items()}
            yield found


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("recordings", nargs="*", default=list(RECORDINGS), help="with truth, or simulated")
    parser.add_argument("--sources", nargs="+", default=list(SOURCES), choices=list(REPLAYED))
    late_help = "seconds by which positions are older than their time stamps"
    parser.add_argument("--late", nargs="+", type=float, default=[0.0, 0.3], help=late_help)
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the recordings")
    add_seeds(parser, 2)
    return parser.parse_args()


def main() -> None:
    """Print a row per recording, receiver, clock and seed as it comes."""
    parser = ScriptParser("experiments.live_antennas", __doc__)
    given = arguments(parser)
    measures = [
        f"{rig} {name}" for rig in ("known", "unknown") for name in ("[m]", "sigma", "NEES", "beyond")
    ]
    table = LiveTable("recording", "receiver", "late [s]", "seed", *measures, numbers=".3g")
    with parser.refusals(), TemporaryDirectory() as scratch:
        results = parser.results(given)
        for one in rows(given, Path(scratch)):
            results.add(**one)
            table.add(*one.values())


if __name__ == "__main__":
    main()
