"""A recording to smooth as a job: plain data in, a short report out, here or on another machine."""

import traceback
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vgps.config import Config
from vgps.errors import VgpsError
from vgps.pipeline.checkpoint import Checkpoint, fingerprint
from vgps.pipeline.offline import smooth
from vgps.readers.recording import open_recording
from vgps.runtime.progress import Progress
from vgps.runtime.timing import sequential_seconds
from vgps.solution import Solution
from vgps.writers.claim import claimed
from vgps.writers.run_folder import FILES, check_writable, write_run


@dataclass(frozen=True, kw_only=True)
class SmoothJob:
    """A recording to smooth.

    Attributes:
        recording: Folder or video.
        out: Run folder to write.
        config: Settings.
        files: Options of :func:`vgps.open_recording`.
        resume: Whether to go on from a checkpoint that is there.
        finished: Digest of the input of the complete run in ``out``, which is then kept if its input is the
            same.
    """

    recording: Path
    out: Path
    config: Config
    files: Mapping[str, Any] = field(default_factory=dict)
    resume: bool = False
    finished: str | None = None


@dataclass(frozen=True, kw_only=True)
class JobReport:
    """How a job ended.

    Attributes:
        recording: As in the job.
        out: As in the job.
        summary: What was done, in one line; empty if it failed.
        warnings: Warnings of the run.
        error: Why the recording was refused, in one line.
        fault: Traceback of a fault of the program.
        digest: Digest of the job's input; None if it failed.
    """

    recording: Path
    out: Path
    summary: str = ""
    warnings: tuple[str, ...] = ()
    error: str | None = None
    fault: str | None = None
    digest: str | None = None

    @property
    def done(self) -> bool:
        """Whether the run folder is complete."""
        return self.digest is not None


def smooth_job(job: SmoothJob, progress: Progress | None = None) -> tuple[Solution | None, str]:
    """Smooth a recording into its run folder.

    Returns:
        The solution, None if the complete run that is there was kept; and the digest of the job's input.

    Raises:
        VgpsError: The recording is refused, or the run cannot be written.
    """
    check_writable(job.out)
    with claimed(job.out):
        opened = open_recording(job.recording, **job.files)
        digest = fingerprint(opened, job.config)
        if digest == job.finished and all((job.out / name).is_file() for name in FILES):
            return None, digest
        checkpoint = Checkpoint(job.out, opened, job.config, resume=job.resume)
        solution = smooth(opened, job.config, progress, checkpoint)
        write_run(solution, job.out)
        checkpoint.remove()
    return solution, digest


def reported(job: SmoothJob, progress: Progress | None = None) -> JobReport:
    """Smooth a recording and report how it ended; a failure is reported too, so that others go on."""
    try:
        solution, digest = smooth_job(job, progress)
    except VgpsError as error:
        return JobReport(recording=job.recording, out=job.out, error=str(error))
    except Exception as error:
        return JobReport(
            recording=job.recording,
            out=job.out,
            error=f"a fault of vgps ({type(error).__name__}: {error})",
            fault=traceback.format_exc(),
        )
    if solution is None:
        return JobReport(recording=job.recording, out=job.out, summary="complete already", digest=digest)
    return JobReport(
        recording=job.recording,
        out=job.out,
        summary=summary_line(solution),
        warnings=tuple(solution.warnings),
        digest=digest,
    )


def summary_line(solution: Solution) -> str:
    """Return the numbers of frames and fixes of a run, and its speed."""
    frames, seconds = len(solution.t_s), sequential_seconds(solution.seconds)
    used = 0 if solution.fixes is None else int(solution.fixes.used.sum())
    logged = 0 if solution.gps is None else len(solution.gps)
    speed = f"{seconds:.1f} s ({frames / max(seconds, 1e-9):.1f} frames/s)"
    return f"{frames} frames posed, {used} of {logged} fixes used, {speed}"
