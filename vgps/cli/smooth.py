"""The verb ``smooth``."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from vgps.cli.app import print_line, print_note
from vgps.cli.options import GpsSettings, RecordingFiles
from vgps.errors import RecordingError
from vgps.solution import Solution

if TYPE_CHECKING:
    from vgps.cluster import JobReport

_FILES, _SETTINGS = RecordingFiles(), GpsSettings()
_FAULT = 1


def smooth(
    recording: Path,
    *,
    out: Path,
    files: RecordingFiles = _FILES,
    settings: GpsSettings = _SETTINGS,
    resume: bool = False,
    scheduler: str | None = None,
) -> None:
    """Estimate the pose of every frame of a recording in world coordinates.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log, or a video with these beside it; or a
            list, a .txt file with a recording per line.
        out: Run folder to write; for a list, the folder of the run folders.
        files: Other files.
        settings: Settings.
        resume: Go on where an interrupted run with the same options left off; complete runs of a list are
            kept.
        scheduler: Smooth on the workers of a dask.distributed scheduler, as tcp://HOST:8786, or of this
            machine, local; they find the recordings under the same paths. Needs the extra cluster.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.cluster import SmoothJob, is_list, read_list, smooth_all, smooth_job, smooth_list

    def job(path: Path, run: Path) -> SmoothJob:
        return SmoothJob(recording=path, out=run, config=config, files=files.options(), resume=resume)

    config, progress = settings.read(), TerminalProgress()
    if is_list(recording):
        jobs = [job(path, out / name) for name, path in read_list(recording).items()]
        _print_reports(smooth_list(jobs, out, scheduler, print_line, progress), len(jobs))
    elif scheduler is not None:
        _print_reports(smooth_all([job(recording, out)], scheduler, print_line), 1)
    else:
        solution, _ = smooth_job(job(recording, out), progress)
        assert solution is not None  # a complete run of one recording is not kept
        print_summary(solution, out)


def _print_reports(reports: "Iterator[JobReport]", total: int) -> None:
    """Print how each recording ended.

    Raises:
        RecordingError: A recording was refused.
    """
    failed: list[JobReport] = []
    for number, report in enumerate(reports, start=1):
        for warning in report.warnings:
            print_note(f"{report.out.name}: {warning}")
        print_line(f"{number} of {total}: {report.error or f'{report.summary}: {report.out}'}")
        failed += [] if report.done else [report]
        if report.fault:
            print_line(report.fault, to_stderr=True)
    if any(report.fault for report in failed):
        sys.exit(_FAULT)
    if failed and total == 1:
        raise RecordingError(failed[0].error or "")
    if failed:
        names = ", ".join(report.out.name for report in failed)
        raise RecordingError(
            f"{len(failed)} of {total} recordings failed: {names}",
            remedy="see the lines above; run the same command with --resume to go on with these only",
        )


def print_summary(solution: Solution, out: Path) -> None:
    """Print the warnings of a run, its check points, its numbers of frames and fixes, and its speed."""
    from vgps.cluster import summary_line
    from vgps.evaluation.check_points import summary_line as check_points_line
    from vgps.evaluation.left_out import left_out_sentences

    for warning in solution.warnings:
        print_note(warning)
    if (checked := check_points_line(solution)) is not None:
        print_line(checked)
    for sentence in left_out_sentences(solution):
        print_line(sentence)
    if len(solution.loops):
        print_line(f"{len(solution.loops)} frames tied to earlier visits of the same places")
    print_line(f"{summary_line(solution)}: {out}")
