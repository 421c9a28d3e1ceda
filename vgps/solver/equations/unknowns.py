"""Places of frames and states among the columns of the reduced matrix, in order of time.

A free frame or a state has a place, six columns; a state of fewer coordinates leaves the last of them empty.
The modules of the matrices and of the groups know only places, and call each of them a frame.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vgps.model import FloatArray, IntArray
from vgps.solver.matrices.band_matrix import POSE_DIM
from vgps.solver.problem import BundleProblem


@dataclass(frozen=True, kw_only=True)
class Unknowns:
    """What the reduced system is solved for: free frames, and the states that stand between them.

    Attributes:
        free: (F,) place of each frame, -1 if its pose is held.
        states: Place of each state by its key.
        n_free: Number of places: of free frames and states.
    """

    free: IntArray
    states: Mapping[int, int]
    n_free: int

    def to_columns(self, frames: FloatArray) -> FloatArray:
        """Return rows (6 n_free, ...) of the reduced system from rows (F, 6, ...) of frames, 0 for states."""
        columns = np.zeros((self.n_free, *frames.shape[1:]))
        moves = self.free >= 0
        columns[self.free[moves]] = frames[moves]
        return columns.reshape(POSE_DIM * self.n_free, *frames.shape[2:])

    def to_frames(self, columns: FloatArray) -> FloatArray:
        """Return rows (F, 6, ...) of frames from rows (6 n_free, ...) of the reduced system, 0 if held."""
        frames = np.zeros((len(self.free), POSE_DIM, *columns.shape[1:]))
        moves = self.free >= 0
        frames[moves] = columns.reshape(self.n_free, POSE_DIM, *columns.shape[1:])[self.free[moves]]
        return frames

    def places(self, problem: BundleProblem, keys: Sequence[int]) -> IntArray:
        """Return the places of the poses and states with these keys; -1 for poses that are held.

        Raises:
            ValueError: A key belongs neither to a pose nor to a state.
        """
        places = np.array([self.states.get(key, -1) for key in keys], dtype=np.int64)
        posed = np.flatnonzero(places < 0)
        places[posed] = self.free[problem.frames_of(keys[i] for i in posed.tolist())]
        return places

    def padding(self, problem: BundleProblem) -> IntArray:
        """Return the columns that no coordinate of a state uses, ascending."""
        sizes = {place: len(problem.states[key].vector) for key, place in self.states.items()}
        parts = [POSE_DIM * place + np.arange(size, POSE_DIM) for place, size in sorted(sizes.items())]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=np.int64)


def number_unknowns(problem: BundleProblem) -> Unknowns:
    """Number free frames and states in order of time, a state after its frame."""
    moves = ~problem.fixed_frames
    keys = sorted(problem.states, key=lambda key: (problem.states[key].frame, key))
    after = np.array([problem.states[key].frame for key in keys], dtype=np.int64)
    free_until = np.cumsum(moves)
    states_before = np.searchsorted(after, np.arange(len(moves)))
    places = free_until[after] + np.arange(len(keys))
    return Unknowns(
        free=np.where(moves, free_until - 1 + states_before, -1),
        states=dict(zip(keys, places.tolist(), strict=True)),
        n_free=int(moves.sum()) + len(keys),
    )
