"""The readout of a rolling shutter as the video shows it, and whether that can be chance.

Rows are displaced in proportion to the readout and to the camera's motion at the time of the frame. The path
through the frames gives that motion, but what is faster than the frames appears in it as a slower motion of
the wrong sign (aliasing), and least squares would find too short a readout: 27 ms instead of 30 in a
simulated hand at 15 frames/s. So the readout is that for which the residuals do not correlate with the
displacements that a **smoothed** path predicts: an instrumental variable (Wright 1928), free of most of that
error.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from factors import path_vectors
from vgps.camera import row_shares
from vgps.errors import GeometryError
from vgps.geometry.path_smoothing import smoothed
from vgps.model import Camera, FloatArray
from vgps.runtime.threads import one_blas_thread
from vgps.smoothing.calibration.camera_equations import pinhole_jacobian
from vgps.smoothing.context import SmoothingContext
from vgps.solver.equations.elimination import SparsityStructure, analyse_sparsity
from vgps.solver.equations.linearised_chunk import LinearisedChunk
from vgps.solver.equations.normal_equations import linearise
from vgps.solver.equations.row_equations import RollingChunk
from vgps.solver.equations.schur_complement import absorbed_residuals
from vgps.solver.gtsam_values import all_pose_values
from vgps.solver.marginals import factorise_pose_system
from vgps.solver.problem import BundleProblem
from vgps.solver.row_times import RowTimes

_BLOCK_S = 1.0  # errors of all tracks together, as of a path between frames, are independent after this time
_LONGEST_SHARE = 1.1  # of the time between frames: a readout cannot be longer
_NOTABLE_SHARE = 0.1  # of the time between frames: an error that bends the path


@dataclass(frozen=True)
class Readout:
    """An estimated readout.

    Attributes:
        readout_s: Time from the first row to the last.
        sigma_s: Its standard deviation.
        frame_s: Median time between frames.
    """

    readout_s: float
    sigma_s: float
    frame_s: float

    def is_shown(self, min_sigmas: float) -> bool:
        """Whether it differs from zero by so many standard deviations, and is possible."""
        possible = abs(self.readout_s) <= self._longest_s
        return possible and abs(self.readout_s) > min_sigmas * self.sigma_s

    def would_show(self, min_sigmas: float) -> bool:
        """Whether half the time between frames, a common readout, would be so many standard deviations."""
        return 0.5 * self.frame_s > min_sigmas * self.sigma_s

    def contradicts(self, given_s: float, min_sigmas: float) -> bool:
        """Whether it is possible, and differs from a given one notably and by so many standard deviations."""
        difference_s, possible = abs(self.readout_s - given_s), abs(self.readout_s) <= self._longest_s
        return possible and difference_s > max(min_sigmas * self.sigma_s, _NOTABLE_SHARE * self.frame_s)

    @property
    def _longest_s(self) -> float:
        return _LONGEST_SHARE * self.frame_s


def estimate_readout(
    problem: BundleProblem, t_s: FloatArray, camera: Camera, camera_sigma: FloatArray
) -> Readout:
    """Return the readout to which a step from an optimum leads, with a standard deviation that holds.

    Pixel sigmas only weigh the residuals; their size and how they hang together come from the residuals
    themselves, once summed by track and once by second (a sandwich estimate with clusters, of which the
    larger counts). Errors of the calibration add to it. Shared vectors are held.

    Args:
        problem: At its optimum, whether or not it has a rolling shutter.
        t_s: (F,) times of the frames.
        camera: The camera.
        camera_sigma: (4,) standard deviations of log focal length, principal point [px] and k1.

    Raises:
        GeometryError: The poses are not determined, or nothing moves in the pictures.
    """
    structure = analyse_sparsity(problem)
    with one_blas_thread():
        linear = linearise(problem, all_pose_values(problem), structure)
        factor, gradient = factorise_pose_system(linear, structure)
        parts = linear.chunks
        rolling = [_with_rows(part, problem, t_s, camera) for part in parts]
        actual, predicted = [p.by_readout for p in rolling], _smooth_displacements(rolling, problem)
        right = [*(_pose_gradient(parts, each, structure) for each in (actual, predicted)), gradient]
        follow = structure.to_frames(-factor.solve(np.column_stack(right)))
    instrument = [_rest(p, z, follow[..., 1]) for p, z in zip(parts, predicted, strict=True)]
    slope = _total(instrument, actual)
    if not slope:
        raise GeometryError("the camera does not move, or has no observations: nothing shows a readout")
    step = -_total(instrument, [p.r for p in parts]) / slope
    poses = follow[..., 2] + step * follow[..., 0]
    left = [_rest(p, p.r + step * each, poses) for p, each in zip(parts, actual, strict=True)]
    by_camera = [
        _total(instrument, J) for J in zip(*(pinhole_jacobian(problem, p) for p in parts), strict=True)
    ]
    variance = _variance(rolling, instrument, left) + float(np.sum((camera_sigma * by_camera) ** 2))
    before_s = 0.0 if problem.row_times is None else problem.row_times.readout_s
    return Readout(before_s + step, float(np.sqrt(variance)) / abs(slope), float(np.median(np.diff(t_s))))


def _with_rows(
    part: LinearisedChunk, problem: BundleProblem, t_s: FloatArray, camera: Camera
) -> RollingChunk:
    """Return a chunk with the times of its rows, without a readout if the problem has none."""
    if isinstance(part, RollingChunk):
        return part
    seen = part.chunk.problem
    times = RowTimes.of_frames(t_s, seen.frame, row_shares(camera, seen.uv_px), 0.0)
    return RollingChunk(**vars(part), row_times=times, vectors=times.vectors(problem.world_T_camera))


def _total(one: Iterable[FloatArray], other: Iterable[FloatArray]) -> float:
    """Return the sum of the products of two arrays for each chunk."""
    return sum(float(np.sum(a * b)) for a, b in zip(one, other, strict=True))


def with_better_readout(
    context: SmoothingContext, problem: BundleProblem, t_s: FloatArray
) -> SmoothingContext:
    """Return the context with the readout improved by the solution of a round, if it is to be estimated."""
    if not context.estimates_readout:
        return context
    try:
        found = estimate_readout(problem, t_s, context.camera, context.config.intrinsics.held_sigmas)
    except GeometryError:  # a frame that hardly sees anything in this round; later ones may see more
        return context
    return replace(context, camera=replace(context.camera, readout_s=found.readout_s))


def _smooth_displacements(parts: Sequence[RollingChunk], problem: BundleProblem) -> list[FloatArray]:
    """Return the derivatives (2, n) of each chunk's residuals by the readout, if the path were smooth."""
    vectors = path_vectors(problem.world_T_camera)
    smooth = smoothed(vectors)
    displacements = []
    for part in parts:
        first = part.row_times.first
        sign = np.sign(vectors[first, :4] @ part.vectors[0, :4])  # of the quaternions
        own = smooth[first : first + len(part.vectors)] * np.where(np.arange(smooth.shape[1]) < 4, sign, 1.0)
        displacements.append(part.moved_by_vectors((part.row_times.by_readout @ own).T))
    return displacements


def _pose_gradient(
    parts: Sequence[LinearisedChunk], residuals: Sequence[FloatArray], structure: SparsityStructure
) -> FloatArray:
    """Return the gradient (6 n_free,) of residuals (2, n) of each chunk, the landmarks eliminated."""
    total = np.zeros((6, len(structure.free)))
    for part, r in zip(parts, residuals, strict=True):
        frames = slice(part.chunk.first_frame, part.chunk.first_frame + part.chunk.frames)
        total[:, frames] += part.pose_gradient(r - absorbed_residuals(part, r))
    return structure.to_columns(total.T)


def _rest(part: LinearisedChunk, r: FloatArray, poses: FloatArray) -> FloatArray:
    """Return what is left of residuals r (2, n) when the poses step (F, 6) and the landmarks follow."""
    moved = r + part.moved_by_poses(poses)
    return moved - absorbed_residuals(part, moved)


def _variance(
    parts: Sequence[RollingChunk], instrument: Sequence[FloatArray], left: Sequence[FloatArray]
) -> float:
    """Return the variance of the instrument's product with the residuals (2, n) that are left."""
    by_track, by_block = 0.0, Counter[float]()
    for part, z, r in zip(parts, instrument, left, strict=True):
        product = np.sum(z * r, axis=0)
        by_track += float(np.sum(np.bincount(part.chunk.landmark, product) ** 2))
        blocks, row = np.unique(np.floor(part.row_times.frame_s / _BLOCK_S), return_inverse=True)
        by_block.update(dict(zip(blocks.tolist(), np.bincount(row, product).tolist(), strict=True)))
    return max(by_track, sum(total**2 for total in by_block.values()))
