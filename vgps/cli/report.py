"""The verb that shows a run to a person."""

from pathlib import Path

from vgps.cli.app import app, say
from vgps.readers.run_folder import read_run


@app.command
def report(run: Path, *, out: Path) -> None:
    """A run as one HTML page: map, verdicts on the fixes, what to doubt, and how it was computed.

    Args:
        run: Run folder.
        out: HTML file to write; it needs no other file.
    """
    from vgps.report import write_report  # noqa: PLC0415  (its plots are slow to import)

    write_report(read_run(run), out)
    say(f"wrote {out}")
