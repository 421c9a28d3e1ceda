"""Verbs that say how good something is."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from vgps.cli.app import app
from vgps.errors import ConfigError
from vgps.evaluate import as_json, as_table, evaluate_run
from vgps.model import GeodeticPoint
from vgps.survey import SurveyOptions, survey_logs
from vgps.survey.output import as_tables, plot_survey, write_survey


@app.command
def evaluate(
    run: Path, *, truth: Path, as_json_text: Annotated[bool, Parameter(name="--json", negative="")] = False
) -> None:
    """Unaligned errors of a run against a truth.

    Args:
        run: Run folder.
        truth: TUM file, world_T_camera in ENU; a rig.yaml beside it names its origin and clock.
        as_json_text: Print JSON instead of a table.
    """
    evaluation = evaluate_run(run, truth)
    if as_json_text:
        print(json.dumps(as_json(evaluation), indent=2))
    else:
        Console().print(as_table(evaluation, str(run)))


@app.command
def survey(
    *logs: Path,
    out: Path,
    truth: str | None = None,
    drop: float = 0.05,
    speed: float = 0.0,
    vertical_speed: float = 0.0,
    frame_rate: float = 30.0,
    plot: Path | None = None,
) -> None:
    """What each fix class of a receiver is worth, from logs taken while it stood still.

    Args:
        logs: GPS logs of a receiver that stands still in one place.
        out: YAML to write, for `vgps smooth --survey`.
        truth: Where it stood, LATITUDE,LONGITUDE,HEIGHT; else the mean of the RTK-fix epochs.
        drop: Share of the worst epochs to drop, horizontally and vertically on their own.
        speed: Of later recordings, m/s: half a frame of motion is added, for fixes snapped to frames.
        vertical_speed: The same upwards.
        frame_rate: Of later recordings.
        plot: Picture of the scatter; beside the YAML if not given.
    """
    options = SurveyOptions(drop, _place(truth), speed, vertical_speed, frame_rate)
    found = survey_logs(logs, options)
    picture = plot or out.with_suffix(".png")
    write_survey(found, options, out)
    plot_survey(found, picture)
    console = Console()
    for table in as_tables(found, options):
        console.print(table)
    for warning in found.warnings:
        console.print(f"[yellow]note:[/yellow] {warning}", highlight=False, soft_wrap=True)
    console.print(f"wrote {out} and {picture}", highlight=False)


def _place(text: str | None) -> GeodeticPoint | None:
    if text is None:
        return None
    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
    except ValueError:
        raise ConfigError(
            f"--truth is {text!r}", expected="LATITUDE,LONGITUDE,HEIGHT in degrees and metres"
        ) from None
    return GeodeticPoint(latitude, longitude, height)
