"""The verb ``survey``."""

import math
from dataclasses import dataclass
from pathlib import Path

from cyclopts import Parameter
from rich.console import Console

from vgps.cli.app import print_line, print_note
from vgps.cli.options import NotNegative
from vgps.config import read_config
from vgps.errors import ConfigError
from vgps.model import GeodeticPoint


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Motion:
    """Motion of later recordings whose fixes are assigned to the nearest frame; it enlarges the regions.

    Attributes:
        speed: Horizontal speed of later recordings [m/s]; half a frame interval of motion is added to r.
        vertical_speed: Vertical speed of later recordings [m/s], added to h likewise.
        frame_rate: Frame rate of later recordings [Hz].
    """

    speed: NotNegative | None = None
    vertical_speed: NotNegative | None = None
    frame_rate: float | None = None


_STILL = Motion()


def survey(
    *logs: Path,
    out: Path,
    truth: str | None = None,
    reference: Path | None = None,
    drop: float | None = None,
    motion: Motion = _STILL,
    plot: Path | None = None,
    config: Path | None = None,
) -> None:
    """Estimate the error region of each fix class, and how its errors change, from logs with a known truth.

    Args:
        logs: GPS logs of a receiver that stood still in one place, or with --reference of drives.
        out: YAML file to write, for `vgps smooth --survey`.
        truth: Position of the antenna, LATITUDE,LONGITUDE,HEIGHT in degrees and metres; by default the mean
            of the RTK-fix epochs.
        reference: Better log of the same antenna on the same drives; its RTK-fix epochs are the truth.
        drop: Share of the worst epochs to ignore, horizontally and vertically each; by default 0.05.
        motion: Motion of later recordings.
        plot: Picture of the scatter; by default beside the YAML file.
        config: YAML file with settings that replace the defaults.
    """
    from vgps.survey import survey_logs
    from vgps.survey.output import as_tables, check_files, plot_survey, write_survey

    resolved = read_config(config).with_survey(
        drop=drop,
        speed_m_s=motion.speed,
        vertical_speed_m_s=motion.vertical_speed,
        frame_rate=motion.frame_rate,
    )
    settings = resolved.survey
    if truth is not None and reference is not None:
        raise ConfigError("--truth and --reference are both given", expected="one of them")
    known = reference if truth is None else _position(truth)
    picture = plot or out.with_suffix(".png")
    check_files(out, picture)
    result = survey_logs(logs, settings, known)
    write_survey(result, settings, out)
    plot_survey(result, picture)
    for table in as_tables(result, settings):
        Console().print(table)
    for warning in result.warnings:
        print_note(warning)
    print_line(f"wrote {out} and {picture}")


def _position(text: str) -> GeodeticPoint:
    try:
        latitude, longitude, height = (float(part) for part in text.split(","))
    except ValueError:
        latitude = longitude = height = math.nan
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and math.isfinite(height)):
        raise ConfigError(f"--truth is {text!r}", expected="LATITUDE,LONGITUDE,HEIGHT in degrees and metres")
    return GeodeticPoint(latitude, longitude, height)
