"""Run folders in, a folder of joined runs out."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from vgps.config import Config
from vgps.errors import RunFolderError, VgpsError
from vgps.model import Recording
from vgps.pipeline.join import Run, join_runs
from vgps.pipeline.join_checkpoint import JoinCheckpoint
from vgps.readers.recording import open_recording
from vgps.readers.run_folder import read_run
from vgps.readers.views.steady import as_posed
from vgps.runtime.progress import Progress
from vgps.solution import JoinedRuns, Solution
from vgps.writers.claim import claimed
from vgps.writers.joined_runs import write_joined
from vgps.writers.run_folder import check_writable

_MIN_RUNS = 2


def join_folders(
    runs: Sequence[Path],
    out: Path,
    config: Config | None = None,
    progress: Progress | None = None,
    *,
    resume: bool = False,
) -> JoinedRuns:
    """Join run folders and write the result.

    Args:
        runs: Run folders, as ``vgps smooth`` writes them.
        out: Folder to write.
        config: Settings; by default those of the first run.
        progress: Progress display.
        resume: Whether to go on where an interrupted adjustment of the same runs left off.

    Raises:
        RunFolderError: Too few runs, two of one name, a run that cannot be joined, or ``out`` cannot be
            written.
        RecordingError, VideoError: The pictures of a run are gone.
    """
    _check(runs, out)
    check_writable(out)
    with claimed(out):
        opened = []
        for path in runs:
            solution = read_run(path)
            opened.append(
                Run(name=path.resolve().name, solution=solution, recording=_recording(path, solution))
            )
        checkpoint = JoinCheckpoint(out, runs, config, resume=resume)
        joined = join_runs(opened, config, progress, checkpoint)
        write_joined(joined, out)
        checkpoint.remove()
    return joined


def _check(runs: Sequence[Path], out: Path) -> None:
    if len(runs) < _MIN_RUNS:
        raise RunFolderError(f"{len(runs)} run", expected="at least two run folders")
    names = Counter(path.resolve().name for path in runs)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        raise RunFolderError(
            f"two runs are named {twice[0]}",
            expected="a name for each, under which --out holds it",
            remedy="rename a run folder",
        )
    for path in runs:
        if out.resolve() == path.resolve() or out.resolve() in path.resolve().parents:
            raise RunFolderError("is or holds a run to join", file=out, remedy="name another --out")


def _recording(path: Path, solution: Solution) -> Recording:
    """Open the recording of a run, whose pictures show which places it shares."""
    if solution.recording is None:
        raise RunFolderError("names no recording, whose pictures show what it shares with others", file=path)
    try:
        recording = open_recording(solution.recording, with_gps=False, cameras=False)
        return as_posed(recording, solution.camera)
    except VgpsError as error:
        raise RunFolderError(
            f"the pictures of its recording cannot be read ({error})",
            file=path,
            expected=f"the recording at {solution.recording}",
            remedy="put it back there",
        ) from error
