"""The verb ``join``."""

from pathlib import Path

from vgps.cli.app import print_line, print_note


def join(*runs: Path, out: Path, config: Path | None = None) -> None:
    """Join several runs of one area in one adjustment: places that they share tie them, fixes of all weigh.

    Args:
        runs: Run folders, as vgps smooth writes them; the recordings must be where they were.
        out: Folder to write: a run folder for each run under its name, in the world of the first, the joint
            points.ply and solution.json.
        config: YAML file with settings that replace those of the first run.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.config import read_config
    from vgps.pipeline.join_folders import join_folders

    settings = None if config is None else read_config(config)
    joined = join_folders(runs, out, settings, TerminalProgress())
    for warning in joined.warnings:
        print_note(warning)
    for row, column in zip(*joined.ties.nonzero(), strict=True):
        frames, later, earlier = joined.ties[row, column], joined.names[row], joined.names[column]
        print_line(f"{frames} frames of {later} see places of {earlier}")
    frames = sum(len(solution.t_s) for solution in joined.solutions)
    print_line(f"{frames} frames of {len(joined.names)} runs in one world: {out}")
