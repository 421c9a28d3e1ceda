"""Do the standard deviations of observations hold? Tracks of which the second half is predicted by the first.

A recording is smoothed without GPS. Every landmark with enough observations is then fitted again to the first
half of them alone, the poses held, with the standard deviation sigma_j (13) of those. Residuals of the second
half are whitened by it and by the landmark's own uncertainty: 1 says that the sigmas hold, more that tracks
err more than they seem to. Independent errors give 0.71, since (13) takes the length of the error as the
sigma of each coordinate. Stage D multiplies sigma_j by `batch.video_sigma_scale`, since tracks drift
together. The poses have seen the second halves, one track among hundreds.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

import vgps
from factors import reliability_sigma_px
from scripts.common.command import ScriptParser, add_seeds
from scripts.common.drives import open_drive
from scripts.common.markdown import LiveTable
from vgps.cli.terminal import TerminalProgress
from vgps.geometry import MIN_DEPTH
from vgps.model import BoolArray, FloatArray, IntArray
from vgps.solution import Solution

_MIN_OBSERVATIONS = 10  # of a track: five say what a landmark's position and its sigma are
_STEPS = 5
_MEDIAN = 2.0 * np.log(2.0)  # of chi-squared with two degrees of freedom


class Halves(NamedTuple):
    """Observations: pose (N, 4, 4), landmark (N,), pixels (N, 2), and whether in the first half (N,)."""

    poses: FloatArray
    landmark: IntArray
    uv_px: FloatArray
    first: BoolArray

    def rows(self, chosen: BoolArray) -> "Halves":
        """Return some of the observations."""
        return Halves(self.poses[chosen], self.landmark[chosen], self.uv_px[chosen], self.first[chosen])


def halves(solution: Solution) -> Halves:
    """Return the observations of long tracks, numbered anew, in two halves by time."""
    seen = solution.observations
    order = np.lexsort((seen.frame, seen.landmark))
    frame, landmark, uv_px = seen.frame[order], seen.landmark[order], seen.uv_px[order]
    count = np.bincount(landmark)
    begin = np.append(0, np.cumsum(count))[:-1]
    place = np.arange(len(landmark)) - begin[landmark]
    long = count[landmark] >= _MIN_OBSERVATIONS
    first = place < count[landmark] // 2
    return Halves(solution.world_T_camera[frame][long], landmark[long], uv_px[long], first[long])


def linearise(
    K: FloatArray, poses: FloatArray, points: FloatArray, uv_px: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return residuals (N, 2) of points (N, 3), one per pose (N, 4, 4), and their Jacobians (N, 2, 3)."""
    world_R_camera = poses[:, :3, :3]
    x, y, z = np.einsum("nij,ni->jn", world_R_camera, points - poses[:, :3, 3])
    z = np.maximum(z, MIN_DEPTH)
    residual = np.stack([K[0, 0] * x / z + K[0, 2], K[1, 1] * y / z + K[1, 2]], axis=1) - uv_px
    zero = np.zeros_like(z)
    u_by = np.stack([K[0, 0] / z, zero, -K[0, 0] * x / z**2], axis=1)
    v_by = np.stack([zero, K[1, 1] / z, -K[1, 1] * y / z**2], axis=1)
    return residual, np.stack([u_by, v_by], axis=1) @ world_R_camera.transpose(0, 2, 1)


def whitened(solution: Solution, floor_px: float) -> FloatArray:
    """Return the squared length (M,) of each residual of a second half over what its first half lets expect.

    If sigmas hold for each coordinate it is a sample of chi-squared with two degrees of freedom.
    """
    seen, K = halves(solution), solution.camera.K
    points, count = solution.landmarks.world_p_landmark.copy(), len(solution.landmarks.world_p_landmark)
    first, second = seen.rows(seen.first), seen.rows(~seen.first)
    for _ in range(_STEPS):
        residual, jacobian = linearise(K, first.poses, points[first.landmark], first.uv_px)
        normal = np.tile(1e-9 * np.eye(3), (count, 1, 1))
        np.add.at(normal, first.landmark, jacobian.transpose(0, 2, 1) @ jacobian)
        right = np.zeros((count, 3))
        np.add.at(right, first.landmark, np.einsum("nij,ni->nj", jacobian, residual))
        points -= np.linalg.solve(normal, right[:, :, None])[:, :, 0]
    residual, _ = linearise(K, first.poses, points[first.landmark], first.uv_px)
    sigma = reliability_sigma_px(residual, first.landmark, count, floor_px)[second.landmark]
    residual, jacobian = linearise(K, second.poses, points[second.landmark], second.uv_px)
    spread = np.eye(2) + jacobian @ np.linalg.solve(normal[second.landmark], jacobian.transpose(0, 2, 1))
    return np.asarray(np.einsum("ni,nij,nj->n", residual, np.linalg.inv(spread), residual) / sigma**2)


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument("recordings", nargs="+", help="as for benchmarks.odometry")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the recordings")
    parser.add_argument("--scenes", type=Path, help="keep simulated recordings here")
    add_seeds(parser, 2)
    return parser.parse_args()


def main() -> None:
    """Print a row per recording and seed."""
    parser = ScriptParser("experiments.observation_sigmas", __doc__)
    given = arguments(parser)
    with parser.refusals(), TemporaryDirectory() as scratch:
        results = parser.results(given)
        table = LiveTable("recording", "seed", "residuals", "whitened, by the median", "RMS", numbers=".2f")
        for name in given.recordings:
            drive = open_drive(name, given.data, given.scenes or Path(scratch))
            for seed in range(given.seeds):
                config = vgps.Config(seed=seed)
                solution = vgps.smooth(drive.recording, config, TerminalProgress())
                squared = whitened(solution, config.mapping.sigma_floor_px)
                found = {
                    "by_median": np.sqrt(np.median(squared) / _MEDIAN),
                    "rms": np.sqrt(squared.mean() / 2),
                }
                results.add(recording=name, seed=seed, residuals=len(squared), **found)
                table.add(name, seed, len(squared), *found.values())


if __name__ == "__main__":
    main()
