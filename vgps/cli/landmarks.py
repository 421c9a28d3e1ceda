"""Verbs about landmark databases."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from rich.console import Console
from rich.table import Table
from rich.text import Text

from vgps.cli.app import app
from vgps.cli.terminal import TerminalProgress
from vgps.config import Frames, LandmarksConfig, read_config
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.info import DatabaseInfo, build_from_runs, database_info
from vgps.writers.atomic import check_file

landmarks = App(name="landmarks", help="Landmark databases: made from runs, to localize other cameras by.")
app.command(landmarks)


@landmarks.command
def build(
    *runs: Path,
    out: Path,
    frames: Frames = "all",
    recording: Path | None = None,
    config: Path | None = None,
    settings: Annotated[LandmarksConfig | None, Parameter(name="*")] = None,
) -> None:
    """Make a landmark database from one or several runs.

    Args:
        runs: Run folders; their worlds need not have the same origin.
        out: Database to write.
        frames: Which frames of the video give templates: all, even or odd. The landmarks' positions are
            those of the whole run in any case.
        recording: Folder of the recording, where it has moved since the run.
        config: YAML that overrides the defaults.
        settings: Which landmarks are known well enough, and what is kept of them.
    """
    check_file(out)
    limits = read_config(config).with_landmarks(settings).landmarks
    contents = build_from_runs(runs, frames, limits, recording, progress=TerminalProgress())
    write_database(contents, out)
    Console().print(_as_table(database_info(out)))


@landmarks.command
def info(database: Path) -> None:
    """Check a landmark database and say what is in it.

    Args:
        database: The file.
    """
    Console().print(_as_table(database_info(database)))


def _as_table(found: DatabaseInfo) -> Table:
    table = Table(show_header=False)
    for _ in range(2):
        table.add_column(overflow="fold")
    table.add_row("database", Text(str(found.path)))
    table.add_row("landmarks", f"{found.landmarks}")
    table.add_row(
        "views", f"{found.views}, {found.levels} levels of {found.patch_px} x {found.patch_px} pixels"
    )
    table.add_row("keyframes", f"{found.keyframes} with {found.descriptors} descriptors")
    if found.world_origin is not None:
        table.add_row("origin", "{:.8f} {:.8f} deg, {:.3f} m".format(*found.world_origin))
    for axis, least, greatest in zip(("east", "north", "up"), *found.extent_m.tolist(), strict=True):
        table.add_row(axis, f"{least:.1f} to {greatest:.1f} m")
    defaults = LandmarksConfig().model_dump(mode="json")
    for source in found.sources:
        # plain JSON: another version's settings may have other names
        given = json.loads(source.settings).items()
        changed = "".join(f", {name} {value}" for name, value in given if value != defaults.get(name))
        holds = f"{source.frames} frames, {source.landmarks} landmarks{changed}"
        table.add_row(Text(f"from {source.recording}"), Text(holds))
    table.add_row("size", f"{found.file_bytes / 2**20:.1f} MB")
    table.add_row("SHA-256", found.sha256)
    return table
