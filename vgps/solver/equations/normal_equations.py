"""Normal equations of a bundle problem, assembled for many observations at once in arrays.

Poses move in GTSAM's tangent, ``world_T_camera * Expmap([rotation; translation])``, so that the pose factors,
which GTSAM linearises, add up with the observations. Arrays over observations have the observation as their
last axis, so that arithmetic runs along contiguous memory.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from scipy import sparse

from vgps.geometry import in_picture
from vgps.model import FloatArray
from vgps.runtime.threads import map_in_order
from vgps.solver.cost import camera_points, pixel_errors, robust_weight, view_poses
from vgps.solver.disk_arrays import DiskArrays, stored
from vgps.solver.equations.chunks import Chunk
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.equations.linearised_chunk import LOWER, DenseChunk, LinearisedChunk, dot, pose_blocks
from vgps.solver.equations.pose_equations import MIN_DIAGONAL, Border, linearise_pose_graph
from vgps.solver.equations.row_equations import RollingChunk, rolling_blocks
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True, kw_only=True)
class Linearisation:
    """Linearised chunks, and the normal equations of poses and states before landmarks are eliminated.

    Attributes:
        chunks: All observations.
        hessian: (6 n_free, 6 n_free) lower triangle.
        gradient: (6 n_free,).
        landmarks: L, number of landmarks of the problem.
        border: Normal equations of the shared vectors.
    """

    chunks: Sequence[LinearisedChunk]
    hessian: sparse.coo_array
    gradient: FloatArray
    landmarks: int
    border: Border

    @property
    def diagonal(self) -> FloatArray:
        """(6 n_free,) diagonal by which damping is scaled."""
        diagonal: FloatArray = np.maximum(self.hessian.diagonal(), MIN_DIAGONAL)
        return diagonal


def linearise(problem: BundleProblem, values: gtsam.Values, structure: SparsityStructure) -> Linearisation:
    """Linearise all observations and pose factors.

    Args:
        problem: The linearisation point.
        values: Its poses, states and shared vectors, for the pose factors.
        structure: Structure of the problem.
    """
    rolling = problem.row_times is not None
    blocks = np.zeros((len(LOWER), len(structure.free)))
    gradient = np.zeros((POSE_DIM, len(structure.free)))

    def linearised(chunk: Chunk) -> tuple[LinearisedChunk, FloatArray | float, FloatArray]:
        part = linearise_chunk(problem, chunk)
        return part, 0.0 if rolling else pose_blocks(part), part.pose_gradient(part.r)

    def parts() -> Iterator[LinearisedChunk]:
        for part, part_blocks, part_gradient in map_in_order(linearised, structure.chunks):
            frames = slice(part.chunk.first_frame, part.chunk.first_frame + part.chunk.frames)
            blocks[:, frames] += part_blocks
            gradient[:, frames] += part_gradient
            yield part

    on_disk = structure.submaps is not None
    chunks = stored(parts(), _on_disk) if on_disk else tuple(parts())
    hessian, factor_gradient, border = linearise_pose_graph(problem, values, structure)
    if rolling:
        blocks, between = rolling_blocks(chunks, structure)
        hessian = hessian + between
    total = (hessian + _block_diagonal(blocks, problem, structure)).tocoo()
    return Linearisation(
        chunks=chunks,
        hessian=total,
        gradient=structure.to_columns(gradient.T) + factor_gradient,
        landmarks=len(problem.world_p_landmark),
        border=border,
    )


def _on_disk(part: LinearisedChunk, arrays: DiskArrays) -> LinearisedChunk:
    """Return the chunk's linearisation with its Jacobians on disk."""
    return replace(part, jp=arrays.kept(part.jp), jl=arrays.kept(part.jl), r=arrays.kept(part.r))


def linearise_chunk(problem: BundleProblem, chunk: Chunk) -> LinearisedChunk:
    """Linearise a chunk's observations at the poses and landmarks of ``problem``."""
    here = chunk.problem.moved(problem.world_T_camera, problem.world_p_landmark)
    here, times, mounts = here.by_view(), here.row_times, here.mounts
    views = view_poses(here)
    camera_p = camera_points(here, views)
    error, behind = pixel_errors(here, camera_p)
    scale = whitening(here, error)
    jp, jl = projection_jacobians(here, camera_p, np.where(behind, 0.0, scale), views)
    if mounts is not None:
        jp = mounts.by_reference(jp)
    r = error * scale
    size = len(chunk.landmarks)
    at = chunk.landmark
    hessian = [np.bincount(at, dot(jl[:, a], jl[:, b]), size) for a in range(3) for b in range(a + 1)]
    gradient = [np.bincount(at, dot(jl[:, a], r), size) for a in range(3)]
    linear = (LinearisedChunk if mounts is None and here.lens is None else DenseChunk)(
        chunk=chunk, jp=jp, jl=jl, r=r, hessian=np.array(hessian), gradient=np.array(gradient)
    )
    if times is None:
        return linear
    return RollingChunk(**vars(linear), row_times=times, vectors=times.vectors(problem.world_T_camera))


def whitening(problem: BundleProblem, error: FloatArray) -> FloatArray:
    """Return the factors (n,) that whiten pixel errors (2, n): the root of the robust weight over sigma."""
    weight = robust_weight(problem, np.sum(error**2, axis=0) / problem.sigma_px**2)
    return np.asarray(np.sqrt(weight) / problem.sigma_px)


def projection_jacobians(
    problem: BundleProblem, camera_p: FloatArray, scale: FloatArray, views: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the Jacobians of the projection to poses (2, 6, n) and to landmarks (2, 3, n), times ``scale``.

    A landmark p in the camera frame moves by ``[p]_x rotation - translation + R^T d(landmark)``.

    Args:
        problem: The observations.
        camera_p: (3, n) from :func:`vgps.solver.cost.camera_points`.
        scale: (n,) zero behind the camera.
        views: (3, 4, n) from :func:`vgps.solver.cost.view_poses`.
    """
    fx, fy, _, _ = problem.intrinsics
    depth = np.where(camera_p[2] > 0.0, camera_p[2], 1.0)
    x, y = camera_p[0] / depth, camera_p[1] / depth
    su, sv = fx * scale, fy * scale
    du, dv = su / depth, sv / depth
    jp = np.zeros((2, POSE_DIM, len(scale)))
    jp[0, 0], jp[0, 1], jp[0, 2] = su * x * y, -su * (1.0 + x * x), su * y
    jp[1, 0], jp[1, 1], jp[1, 2] = sv * (1.0 + y * y), -sv * x * y, -sv * x
    jp[0, 3], jp[0, 5] = -du, du * x
    jp[1, 4], jp[1, 5] = -dv, dv * y
    jl = np.empty((2, 3, len(scale)))
    for axis in range(3):
        R = views[axis]
        jl[0, axis] = du * (R[0] - x * R[2])
        jl[1, axis] = dv * (R[1] - y * R[2])
    return in_picture(problem.lens, jp), in_picture(problem.lens, jl)


def _block_diagonal(
    blocks: FloatArray, problem: BundleProblem, structure: SparsityStructure
) -> sparse.csr_array:
    """Return the frames' blocks (21, F) at their places, and ones where a state leaves a column empty."""
    moves, padding = structure.free >= 0, structure.padding(problem)
    at = POSE_DIM * structure.free[moves]
    rows, columns = ((at + index[:, None]).ravel() for index in np.array(LOWER).T)
    index = np.append(rows, padding), np.append(columns, padding)
    values = np.append(blocks[:, moves].ravel(), np.ones(len(padding)))
    size = POSE_DIM * structure.n_free
    return sparse.csr_array((values, index), shape=(size, size))
