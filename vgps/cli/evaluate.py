"""Verbs that say how good something is."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from vgps.cli.app import app, note, say
from vgps.cli.terminal import TerminalProgress
from vgps.config import read_config
from vgps.errors import ConfigError
from vgps.evaluation import comparison_table, evaluation_table, to_json
from vgps.evaluation import evaluate as evaluate_run
from vgps.model import GeodeticPoint
from vgps.readers.recording import open_recording
from vgps.survey import SurveyOptions, survey_logs
from vgps.survey.output import as_tables, check_files, plot_survey, write_survey


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
        print(json.dumps(to_json(evaluation), indent=2))
    else:
        Console().print(evaluation_table(evaluation, str(run)))


@app.command
def compare(
    recording: Path,
    *,
    truth: Path,
    out: Path,
    gps: str | None = None,
    survey: Path | None = None,
    config: Path | None = None,
    seed: int | None = None,
) -> None:
    """Every GPS model side by side: methods A to D of the thesis, the cylinder, and a robust Gaussian.

    Args:
        recording: Folder with video, camera.yaml, rig.yaml and GPS log.
        truth: TUM file, world_T_camera in ENU; a rig.yaml beside it names its origin and clock.
        out: Folder for comparison.html and comparison.json.
        gps: GPS log, a path or a name inside the folder.
        survey: YAML with the region r_m, h_m of each fix class.
        config: YAML that overrides the defaults.
        seed: Of every random choice.
    """
    from vgps.compare import compare as compare_models  # noqa: PLC0415  (its plots are slow to import)
    from vgps.compare import write_comparison  # noqa: PLC0415

    settings = read_config(config).with_gps(None, survey).with_seed(seed)
    found = compare_models(open_recording(recording, gps=gps), truth, settings, TerminalProgress())
    page, data = write_comparison(found, out)
    Console().print(comparison_table(list(found.evaluations.items()), str(recording)))
    say(f"wrote {page} and {data}")


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
    options = SurveyOptions(
        drop=drop,
        truth=_place(truth),
        speed_m_s=speed,
        vertical_speed_m_s=vertical_speed,
        frame_rate=frame_rate,
    )
    picture = plot or out.with_suffix(".png")
    check_files(out, picture)
    found = survey_logs(logs, options)
    write_survey(found, options, out)
    plot_survey(found, picture)
    for rendered in as_tables(found, options):
        Console().print(rendered)
    for warning in found.warnings:
        note(warning)
    say(f"wrote {out} and {picture}")


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
