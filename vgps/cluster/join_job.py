"""Runs to join as a job: plain data in, a short report out, here or on a worker."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from vgps.cluster.scheduler import run_one
from vgps.config import Config
from vgps.errors import RunFolderError, VgpsError
from vgps.pipeline.checkpoint import forget_checkpoint
from vgps.pipeline.join_folders import join_folders
from vgps.runtime.progress import Progress
from vgps.solution import JoinedRuns


@dataclass(frozen=True, kw_only=True)
class JoinJob:
    """Runs to join.

    Attributes:
        runs: Run folders.
        out: Folder to write.
        config: Settings that replace those of the first run.
        resume: Whether to go on from a checkpoint that is there.
    """

    runs: tuple[Path, ...]
    out: Path
    config: Config | None = None
    resume: bool = False


@dataclass(frozen=True, kw_only=True)
class JoinReport:
    """How the runs were joined: lines for the user, warnings, and why it was refused, if it was."""

    lines: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    error: str | None = None


def join_job(
    job: JoinJob,
    scheduler: str | None = None,
    announce: Callable[[str], None] = lambda _: None,
    progress: Progress | None = None,
) -> JoinReport:
    """Join runs, here or on a worker of a scheduler.

    Args:
        job: The runs.
        scheduler: Address of a dask.distributed scheduler, or ``local``; None for this process.
        announce: Called with lines about the cluster.
        progress: Progress display, in this process.

    Raises:
        RunFolderError: The runs cannot be joined.
        ClusterError: The scheduler cannot be reached, or its workers have other versions.
    """
    if scheduler is None:
        return _report(join_folders(job.runs, job.out, job.config, progress, resume=job.resume))
    if not job.resume:
        forget_checkpoint(job.out)
    # the job of a lost worker goes on from its checkpoint; workers have other working directories
    runs = tuple(path.absolute() for path in job.runs)
    report = run_one(
        _reported, replace(job, runs=runs, out=job.out.absolute(), resume=True), scheduler, announce
    )
    if report.error is not None:
        raise RunFolderError(report.error)
    return report


def _reported(job: JoinJob) -> JoinReport:
    """Join runs and report how it ended, a refusal included."""
    try:
        return _report(join_folders(job.runs, job.out, job.config, resume=job.resume))
    except VgpsError as error:
        return JoinReport(error=str(error))


def _report(joined: JoinedRuns) -> JoinReport:
    lines = [
        f"{joined.ties[row, column]} frames of {joined.names[row]} see places of {joined.names[column]}"
        for row, column in zip(*joined.ties.nonzero(), strict=True)
    ]
    frames = sum(len(solution.t_s) for solution in joined.solutions)
    lines.append(f"{frames} frames of {len(joined.names)} runs in one world")
    return JoinReport(lines=tuple(lines), warnings=joined.warnings)
