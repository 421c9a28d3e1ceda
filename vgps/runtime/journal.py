"""Results of long steps on disk: an interrupted run takes them instead of computing them again."""

import hashlib
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from vgps.runtime.state_file import read_state, write_checkpoint

Result = TypeVar("Result")

_WORTH_S = 5.0  # what takes less is computed again


class Journal:
    """Steps of a computation that does the same each time, by number; each long one has a file.

    Args:
        folder: The files' folder; it appears with the first one.
        run: Digest of what decides the results; steps of another run do not count.
        resume: Whether steps that are there count; else they are replaced.
    """

    def __init__(self, folder: Path, run: str, *, resume: bool) -> None:
        self._folder, self._run, self._resume = folder, run, resume
        self._steps = 0

    def step(
        self,
        start: Iterable[npt.NDArray[np.float64]],
        compute: Callable[[], Result],
        classes: Sequence[type],
    ) -> Result:
        """Return the result of the next step, from its file if there is one.

        Args:
            start: Arrays where the step begins; a file that began elsewhere does not count.
            compute: The step.
            classes: Classes of the objects in its result.

        Raises:
            RunFolderError: The file is damaged, or cannot be written.
        """
        self._steps += 1
        file, key = self._folder / f"step_{self._steps}.npz", self._key(start)
        if self._resume and file.is_file():
            state = read_state(file, classes)
            if state.get("key") == key:
                found: Result = state["result"]
                return found
        begun = time.monotonic()
        result = compute()
        if time.monotonic() - begun >= _WORTH_S:
            write_checkpoint({"key": key, "result": result}, file, classes)
        return result

    def _key(self, start: Iterable[npt.NDArray[np.float64]]) -> str:
        digest = hashlib.sha256(self._run.encode())
        for array in start:
            digest.update(array.tobytes())
        return digest.hexdigest()
