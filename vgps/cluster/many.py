"""Many recordings, a run folder for each."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from vgps.cluster.job import JobReport, SmoothJob, reported
from vgps.cluster.scheduler import run_on_cluster
from vgps.errors import RunFolderError
from vgps.pipeline.checkpoint import forget_checkpoint
from vgps.runtime.progress import Progress
from vgps.writers.atomic import MARK, new_file
from vgps.writers.claim import claimed, not_writable

RUNS_FILE = "runs.json"
_SCHEMA_VERSION = 1


def smooth_all(
    jobs: Sequence[SmoothJob],
    scheduler: str | None = None,
    announce: Callable[[str], None] = lambda _: None,
    progress: Progress | None = None,
) -> Iterator[JobReport]:
    """Smooth recordings one after the other or on a cluster, and yield reports as they end.

    Args:
        jobs: The recordings.
        scheduler: Address of a dask.distributed scheduler, or ``local``; None for one after the other.
        announce: Called with lines about the cluster.
        progress: Progress display, for one after the other.

    Raises:
        ClusterError: The scheduler cannot be reached, or its workers have other versions.
    """
    if scheduler is None:
        return (reported(job, progress) for job in jobs)
    for job in jobs:
        if not job.resume:
            forget_checkpoint(job.out)
    # the job of a lost worker goes on from its checkpoint
    return run_on_cluster([replace(_anywhere(job), resume=True) for job in jobs], scheduler, announce)


def _anywhere(job: SmoothJob) -> SmoothJob:
    """Return the job with absolute paths: workers have other working directories."""
    folder = job.recording if job.recording.is_dir() else job.recording.parent
    here = {
        name: Path(value).absolute()
        for name, value in job.files.items()
        if isinstance(value, str) and Path(value).is_file() and not (folder / value).is_file()
    }
    files = {**job.files, **here}
    system = files.get("control_system")
    if system is not None and system.geoid is not None and Path(system.geoid).is_file():
        files["control_system"] = replace(system, geoid=str(Path(system.geoid).absolute()))
    return replace(job, recording=job.recording.absolute(), out=job.out.absolute(), files=files)


def smooth_list(
    jobs: Sequence[SmoothJob],
    out: Path,
    scheduler: str | None = None,
    announce: Callable[[str], None] = lambda _: None,
    progress: Progress | None = None,
) -> Iterator[JobReport]:
    """Smooth recordings into folders below ``out``, as :func:`smooth_all`.

    ``runs.json`` there says after every recording how each one ended. Jobs that resume keep the runs that it
    calls done, if their input is the same.

    Raises:
        RunFolderError: ``out`` is a run itself, or cannot be written.
        ClusterError: As in :func:`smooth_all`.
    """
    if (out / MARK).exists():
        raise RunFolderError("is a run folder", file=out, remedy="name a folder for the folders of the runs")
    with claimed(out):
        try:
            out.mkdir(exist_ok=True)
        except OSError as error:
            raise not_writable(out, error) from error
        digest = _finished(out / RUNS_FILE)
        jobs = [replace(job, finished=digest.get(job.out.name)) if job.resume else job for job in jobs]
        ended: list[JobReport] = []
        for report in smooth_all(jobs, scheduler, announce, progress):
            ended.append(report)
            _write_runs(jobs, ended, out)
            yield report


def _finished(file: Path) -> dict[str, str]:
    """Return the digests of the input of complete runs by their names."""
    try:
        runs = json.loads(file.read_text(encoding="utf-8"))["runs"]
        return {str(run["run"]): str(run["digest"]) for run in runs if run["state"] == "done"}
    except (OSError, ValueError, LookupError, TypeError):
        return {}


def _write_runs(jobs: Sequence[SmoothJob], ended: Sequence[JobReport], out: Path) -> None:
    """Write how each recording ended, in the order of the list."""
    by_name = {report.out.name: report for report in ended}
    runs = []
    for job in jobs:
        report = by_name.get(job.out.name)
        if report is None and job.finished is not None:  # as far as is known
            report = JobReport(recording=job.recording, out=job.out, digest=job.finished)
        state = "waiting" if report is None else "done" if report.done else "failed"
        row = {"run": job.out.name, "recording": str(job.recording), "state": state}
        row |= {"digest": report.digest} if report is not None and report.digest else {}
        row |= {"error": report.error} if report is not None and report.error else {}
        runs.append(row)
    with new_file(out / RUNS_FILE) as scratch:
        text = json.dumps({"schema_version": _SCHEMA_VERSION, "runs": runs}, indent=2, ensure_ascii=False)
        scratch.write_text(text + "\n", encoding="utf-8")
