"""The verb ``join``."""

from pathlib import Path

from vgps.cli.app import print_line, print_note


def join(
    *runs: Path,
    out: Path,
    config: Path | None = None,
    resume: bool = False,
    scheduler: str | None = None,
) -> None:
    """Join several runs of one area in one adjustment, by the places that they share and the fixes of all.

    Args:
        runs: Run folders, as vgps smooth writes them; the recordings must be where they were.
        out: Folder to write: a run folder for each run under its name, in the world of the first, the joint
            points.ply and solution.json.
        config: YAML file with settings that replace those of the first run.
        resume: Go on where an interrupted join of the same runs left off.
        scheduler: Join on a worker of a dask.distributed scheduler, as tcp://HOST:8786, or of this machine,
            local; it finds the runs and recordings under the same paths. Needs the extra cluster.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.cluster import JoinJob, join_job
    from vgps.config import read_config

    settings = None if config is None else read_config(config)
    job = JoinJob(runs=runs, out=out, config=settings, resume=resume)
    report = join_job(job, scheduler, print_line, TerminalProgress())
    for warning in report.warnings:
        print_note(warning)
    for line in report.lines[:-1]:
        print_line(line)
    print_line(f"{report.lines[-1]}: {out}")
