"""The verbs ``landmarks build`` and ``landmarks info``."""

from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.console import Console

from vgps.config import Frames, LandmarksConfig, read_config

landmarks = App(name="landmarks", help="Build and check landmark databases, against which `track` localises.")


@landmarks.command
def build(
    *runs: Path,
    out: Path,
    frames: Frames = "all",
    recording: Path | None = None,
    config: Path | None = None,
    settings: Annotated[LandmarksConfig | None, Parameter(name="*")] = None,
) -> None:
    """Build a landmark database from one or several runs.

    Args:
        runs: Run folders, whose world origins may differ, or what vgps join wrote.
        out: Database to write.
        frames: Frames of the video from which templates are taken: all, even or odd. The landmarks'
            positions are always those of the whole run.
        recording: Folder of the recording, if it was moved after the run.
        config: YAML file with settings that replace the defaults.
        settings: Which landmarks are accurate enough, and what is stored of them.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.landmarks.build import build_from_runs
    from vgps.landmarks.database_writer import write_database
    from vgps.writers.atomic import check_file

    check_file(out)
    limits = read_config(config).with_landmarks(settings).landmarks
    contents = build_from_runs(runs, frames, limits, recording, progress=TerminalProgress())
    write_database(contents, out)
    info(out)


@landmarks.command
def info(database: Path) -> None:
    """Check a landmark database and print its contents.

    Args:
        database: The database.
    """
    from vgps.cli.tables import database_table
    from vgps.landmarks.info import database_info

    Console().print(database_table(database_info(database)))
