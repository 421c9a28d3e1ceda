"""The verb ``report``."""

from pathlib import Path

from vgps.cli.app import app, print_line
from vgps.readers.run_folder import read_run


@app.command
def report(run: Path, *, out: Path) -> None:
    """Write a run as one HTML page: warnings, path, verdicts on the fixes, plots over time.

    Args:
        run: Run folder.
        out: HTML file to write; it needs no other file.
    """
    from vgps.report import write_report  # noqa: PLC0415  (plots are slow to import)

    write_report(read_run(run), out)
    print_line(f"wrote {out}")
