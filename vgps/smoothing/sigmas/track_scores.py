"""What the tracks' residuals contribute to the reduced gradient: errors of tracks are drawn by these."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import sparse

from vgps.model import FloatArray, IntArray
from vgps.solver.disk_arrays import DiskArrays, stored
from vgps.solver.equations.elimination import SparsityStructure
from vgps.solver.equations.linearised_chunk import LinearisedChunk
from vgps.solver.equations.normal_equations import Linearisation
from vgps.solver.equations.schur_complement import pose_scores
from vgps.solver.matrices.band_matrix import POSE_DIM


@dataclass(frozen=True)
class TrackScores:
    """Contributions of a chunk's landmarks.

    Attributes:
        landmarks: (m,) rows of the landmarks in the problem.
        first: First column of the reduced system that they contribute to.
        by_track: (k, m) contributions to this column and those after it.
    """

    landmarks: IntArray
    first: int
    by_track: sparse.csr_array

    def add_to(self, total: FloatArray, signs: npt.NDArray[np.int8]) -> None:
        """Add to totals (6 n_free, K) the contributions times signs (L, K) of the landmarks."""
        rows = slice(self.first, self.first + self.by_track.shape[0])
        total[rows] += self.by_track @ signs[self.landmarks]


def track_scores(linear: Linearisation, structure: SparsityStructure, on_disk: bool) -> Iterable[TrackScores]:
    """Return the contributions of all chunks: as they are computed, or on disk to be taken more than once.

    Args:
        linear: The problem, linearised at its optimum.
        structure: Its structure.
        on_disk: Whether they are to be kept on disk.
    """
    scores = _all_scores(linear, structure)
    return stored(scores, _on_disk) if on_disk else scores


def _all_scores(linear: Linearisation, structure: SparsityStructure) -> Iterator[TrackScores]:
    for part in linear.chunks:
        places = structure.free[part.chunk.first_frame + part.chunk.coupled.frame]
        if np.any(places >= 0):
            yield _scores(part, places)


def _scores(part: LinearisedChunk, places: IntArray) -> TrackScores:
    """Return the contributions of a chunk, whose coupled pairs have these places (c,)."""
    chunk, free = part.chunk, places >= 0
    first, last = int(places[free].min()), int(places.max())
    index = (POSE_DIM * (places[free] - first) + np.arange(POSE_DIM)[:, None]).ravel()
    tracks = np.tile(chunk.coupled.landmark[free], POSE_DIM)
    by_track = sparse.csr_array(
        (pose_scores(part)[:, free].ravel(), (index, tracks)),
        shape=(POSE_DIM * (last + 1 - first), len(chunk.landmarks)),
    )
    return TrackScores(chunk.landmarks, POSE_DIM * first, by_track)


def _on_disk(scores: TrackScores, arrays: DiskArrays) -> TrackScores:
    """Return the contributions with their numbers on disk."""
    matrix, kept = scores.by_track, arrays.kept
    entries = (kept(matrix.data), kept(matrix.indices), kept(matrix.indptr))
    return replace(scores, by_track=sparse.csr_array(entries, shape=matrix.shape))
