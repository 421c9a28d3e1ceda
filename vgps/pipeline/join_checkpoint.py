"""A checkpoint of joined runs, from which an interrupted adjustment goes on."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from vgps.config import Config
from vgps.errors import RunFolderError
from vgps.pipeline.checkpoint import checkpoint_folder, digest, file_stamp
from vgps.places.loops import Loop
from vgps.runtime.journal import Journal
from vgps.runtime.state_file import read_state, write_checkpoint


class JoinCheckpoint:
    """The places that runs share, and the steps of stage D, in a hidden folder beside the joined runs.

    Args:
        out: Folder of the joined runs.
        runs: Run folders.
        config: Settings that replace those of the first run.
        resume: Whether to take over the places that are there; else they are replaced.

    Attributes:
        journal: Long steps of stage D.
    """

    def __init__(self, out: Path, runs: Sequence[Path], config: Config | None, *, resume: bool) -> None:
        self._file = checkpoint_folder(out) / "places.npz"
        self._runs, self._resume = _fingerprint(runs, config), resume
        self.journal = Journal(self._file.parent, self._runs, resume=resume)

    def loops(self, find: Callable[[], tuple[Loop, ...]]) -> tuple[Loop, ...]:
        """Return the loops of the checkpoint; without one, find and store them.

        Raises:
            RunFolderError: The checkpoint is damaged, or of other runs; or it cannot be written.
        """
        if self._resume and self._file.is_file():
            state = read_state(self._file, (Loop,))
            if state.get("runs") != self._runs:
                raise RunFolderError(
                    "the interrupted adjustment has other runs, settings or another version of vgps",
                    file=self._file,
                    remedy="join as before, or without --resume",
                )
            return tuple(state["loops"])
        loops = find()
        write_checkpoint({"runs": self._runs, "loops": loops}, self._file, (Loop,))
        return loops

    def remove(self) -> None:
        """Remove the checkpoint, after the joined runs are written."""
        shutil.rmtree(self._file.parent, ignore_errors=True)


def _fingerprint(runs: Sequence[Path], config: Config | None) -> str:
    """Return a digest of what decides the places that runs share."""
    parts = {
        "config": None if config is None else config.model_dump(mode="json"),
        "runs": [file_stamp(path.resolve() / "measurements.npz") for path in runs],
    }
    return digest(parts)
