"""A run folder exported to the files of other programs: one entry per format."""

from collections.abc import Callable
from pathlib import Path

from vgps.errors import RunFolderError
from vgps.readers.run_folder import read_run
from vgps.solution import Solution
from vgps.writers.placing import new_file
from vgps.writers.ply import write_ply
from vgps.writers.tum import write_tum


def _tum(solution: Solution, out: Path) -> None:
    write_tum(solution.trajectory, out)


def _ply(solution: Solution, out: Path) -> None:
    write_ply(solution.landmarks, solution.observations, solution.world_origin, out)


FORMATS: dict[str, Callable[[Solution, Path], None]] = {"tum": _tum, "ply": _ply}


def export(run: Path, to: str, out: Path) -> None:
    """Export the run folder ``run`` in the format ``to``, one of :data:`FORMATS`, to the file ``out``.

    Raises:
        RunFolderError: The run cannot be read, the format is unknown, or ``out`` cannot be written.
    """
    write = FORMATS.get(to)
    if write is None:
        raise RunFolderError(f"unknown format {to!r}", expected="one of " + ", ".join(sorted(FORMATS)))
    solution = read_run(run)
    with new_file(out) as scratch:
        write(solution, scratch)
