"""The verb ``report``."""

from pathlib import Path

from vgps.cli.app import print_line


def report(run: Path, *, out: Path, crs: str | None = None, geoid: str | None = None) -> None:
    """Write a run as one HTML page: warnings, datum, path, verdicts on the fixes, check points, plots.

    Args:
        run: Run folder.
        out: HTML file to write; it needs no other file.
        crs: Coordinate system to state coordinates in, as EPSG:25832+7837; by default WGS 84.
        geoid: What heights are above: egm96, a grid file, or metres; by default the ellipsoid.
    """
    from vgps.evaluation.check_points import summary_line
    from vgps.readers.run_files import read_summary
    from vgps.readers.run_folder import read_run
    from vgps.report import write_report

    solution = read_run(run)
    write_report(solution, out, crs=crs, geoid=geoid, versions=read_summary(run).get("versions"))
    checked = summary_line(solution)
    if checked is not None:
        print_line(checked)
    print_line(f"wrote {out}")
