"""How far does `vgps smooth` drift without GPS?

Errors of the camera centre after a similarity to the truth, and how far the scale drifts, for each seed. The
scale is that of 10 m of the true path, relative to its median.
"""

from pathlib import Path

import numpy as np

import vgps
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.markdown import LiveTable
from vgps.cli.terminal import TerminalProgress
from vgps.evaluation import align
from vgps.geometry import interpolate_poses
from vgps.model import FloatArray
from vgps.readers.trajectory import read_trajectory

COLUMNS = ["recording", "seed", "RMSE [m]", "least scale", "largest scale", "focal length [px]", "time [s]"]
_STEP_M = 10.0  # of the true path, over which a scale is taken


def scales(centres: FloatArray, true: FloatArray) -> FloatArray:
    """Return scales (n,) of centres (N, 3) by pieces of the true path (N, 3), relative to their median."""
    travelled = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(true, axis=0), axis=1)))
    ends = np.unique(np.searchsorted(travelled, np.arange(0.0, travelled[-1], _STEP_M)))
    chord, true_chord = (np.linalg.norm(np.diff(x[ends], axis=0), axis=1) for x in (centres, true))
    ratio = chord / np.maximum(true_chord, 1e-9)
    return np.asarray(ratio / np.median(ratio))


def one_run(recording: Path, gps: str, seed: int) -> dict[str, str | int | float]:
    """Return the result of one seed.

    Raises:
        VgpsError: The recording cannot be read or smoothed.
    """
    config = vgps.Config(seed=seed).with_gps("none")
    solution = vgps.smooth(vgps.open_recording(recording, gps=gps), config, TerminalProgress())
    truth = read_trajectory(recording / "truth.tum")
    inside = (solution.t_s >= truth.t_s[0]) & (solution.t_s <= truth.t_s[-1])
    true = interpolate_poses(truth.t_s, truth.world_T_camera, solution.t_s[inside])[:, :3, 3]
    centres = solution.world_T_camera[inside, :3, 3]
    aligned, scale = align(centres, true, with_scale=True), scales(centres, true)
    rmse = float(np.sqrt(np.mean(np.sum(aligned[1] ** 2, axis=1)))) if aligned else float("nan")
    return {
        "recording": recording.name,
        "seed": seed,
        "rmse_m": rmse,
        "scale_min": float(scale.min()),
        "scale_max": float(scale.max()),
        "focal_px": solution.camera.fx,
        "time_s": float(sum(solution.seconds[name] for name in ("decode", "start", "track", "map", "batch"))),
    }


def main() -> None:
    """Print a row per seed as it comes."""
    parser = ScriptParser("benchmarks.odometry", __doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--gps", default="gps_fix.nmea", help="a log of the recording; not used")
    add_seeds(parser, 5)
    given = parser.parse_args()
    with parser.refusals():
        results, table = parser.results(given), LiveTable(*COLUMNS)
        for seed in range(given.seeds):
            found = one_run(given.recording, given.gps, seed)
            results.add(**found)
            table.add(*(f"{x:.3f}" if isinstance(x, float) else str(x) for x in found.values()))


if __name__ == "__main__":
    main()
