"""An index of words: which views share descriptors, without comparing all of them.

A word is a choice of bits of a binary descriptor (locality-sensitive hashing, Indyk and Motwani 1998): equal
descriptors have equal words, similar ones have some in common. A rare word says more than a frequent one
(inverse document frequency, Sivic and Zisserman 2003). Nothing is trained.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from vgps.landmarks.descriptors import Descriptors
from vgps.model import FloatArray, IntArray

_TABLES, _BITS = 8, 16  # words of a descriptor, and bits of a word
_DESCRIPTOR_BITS = 256


class WordIndex:
    """Words of views, by the frame of the view."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self._chosen = np.stack([rng.choice(_DESCRIPTOR_BITS, _BITS, replace=False) for _ in range(_TABLES)])
        self._views = np.zeros(_TABLES << _BITS, dtype=np.int64)  # that have each word
        self._words: dict[int, npt.NDArray[np.int32]] = {}

    def words(self, descriptors: Descriptors) -> IntArray:
        """Return the words (n,) of descriptors (N, 32), each once."""
        bits = np.unpackbits(descriptors, axis=1)[:, self._chosen].astype(np.int64)
        codes = bits @ (1 << np.arange(_BITS)) + (np.arange(_TABLES) << _BITS)
        return np.unique(codes)

    def add(self, frame: int, words: IntArray) -> None:
        """Add the view of a frame."""
        self._words[frame] = words.astype(np.int32)
        self._views[words] += 1

    def discard(self, frame: int) -> None:
        """Forget the words of a view; how frequent they are stays known."""
        self._words.pop(frame, None)

    def candidates(self, words: IntArray, frames: IntArray, count: int) -> IntArray:
        """Return which of some views to compare a view with: the nearest, and of the others the most alike.

        Args:
            words: (m,) of the view.
            frames: (n,) of the others, the nearest first.
            count: How many to compare at most; half of them are the nearest.

        Returns:
            Rows (k,) of ``frames``.
        """
        near = min(count // 2, len(frames))
        alike = np.argsort(-self.similarity(words, frames[near:].tolist()), kind="stable")
        return np.append(np.arange(near), near + alike[: count - near])

    def similarity(self, words: IntArray, frames: Sequence[int]) -> FloatArray:
        """Return how much words (n,) have in common with the views of frames (k,); rare words count more."""
        total = max(len(self._words), 1)
        weight = np.zeros(len(self._views))
        weight[words] = np.log1p(total / np.maximum(self._views[words], 1))
        return np.array([weight[self._words[frame]].sum() for frame in frames])
