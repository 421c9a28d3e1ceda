"""Surveys as files for ``smooth --survey``, as tables and as plots."""

from dataclasses import asdict
from pathlib import Path

import yaml
from rich.table import Table

from vgps.config import SurveyConfig
from vgps.errors import GpsLogError, RunFolderError
from vgps.survey.regions import ClassSurvey
from vgps.survey.survey import Survey
from vgps.writers.atomic import check_file, new_file

_PICTURES = ("png", "jpg", "jpeg", "webp", "svg", "pdf")
_COLOURS = {"rtk_fix": "#2a9d8f", "rtk_float": "#e9a23b", "single": "#c8553d"}


def check_files(out: Path, picture: Path) -> None:
    """Check before the work that the survey and its plot can be written; change nothing.

    Raises:
        RunFolderError: They are the same file, the suffix of ``picture`` is not that of an image format, or
            one of them cannot be written.
    """
    if picture.resolve() == out.resolve():
        raise RunFolderError(
            "is the name of both the survey and its plot",
            file=out,
            remedy="name another file with --plot",
        )
    if _format(picture) not in _PICTURES:
        raise RunFolderError(
            f"cannot plot to {picture.suffix or 'a file without a suffix'}",
            file=picture,
            expected=", ".join(f".{name}" for name in _PICTURES),
        )
    check_file(out)
    check_file(picture)


def _format(picture: Path) -> str:
    return picture.suffix.removeprefix(".").lower()


def write_survey(survey: Survey, config: SurveyConfig, out: Path) -> None:
    """Write the regions and the memory per class as YAML, with the survey's settings."""
    document: dict[str, object] = {str(one.fix_class): _keys(one) for one in survey.classes}
    truth = (
        {"reference": str(survey.truth)}
        if isinstance(survey.truth, Path)
        else {"truth": dict(zip(("latitude_deg", "longitude_deg", "height_m"), survey.truth, strict=True))}
    )
    document["survey"] = {"drop": config.drop, **truth, "warnings": list(survey.warnings)}
    with new_file(out) as scratch:
        scratch.write_text(yaml.safe_dump(document, sort_keys=False), encoding="utf-8")


def _keys(one: ClassSurvey) -> dict[str, float]:
    """Return the keys of a class: regions to a tenth of a millimetre, memory to three digits."""
    memory = {} if one.memory is None else asdict(one.memory)
    return {
        "r_m": round(one.r_m, 4),
        "h_m": round(one.h_m, 4),
        "alpha_m": round(one.ellipsoid.alpha_m, 4),
        "beta_m": round(one.ellipsoid.beta_m, 4),
        **{name: float(f"{value:.3g}") for name, value in memory.items()},
        "epochs": one.epochs,
        "independent_epochs": round(one.independent, 1),
        "correlation_s": round(one.correlation_s, 1),
    }


def as_tables(survey: Survey, config: SurveyConfig) -> list[Table]:
    """Return the tables 4 and 5 of Kume 2010, in metres, and how errors change."""
    dropped = f"worst {100 * config.drop:g} % dropped"
    cylinders = Table(
        "class", "epochs", "independent", "all: horiz / vert, m", f"{dropped}: r / h, m", title="Cylinders"
    )
    ellipsoids = Table("class", "alpha, m", "beta, m", "correlation, s", title="Least ellipsoids")
    memories = Table(
        "class", "noise, m", "walk in 1 s, m", "tail", "vertical", "changes", title="Changes of the error"
    )
    for one in survey.classes:
        largest = f"{one.largest_m[0]:.3f} / {one.largest_m[1]:.3f}"
        cylinders.add_row(
            one.fix_class,
            str(one.epochs),
            f"{one.independent:.0f}",
            largest,
            f"{one.r_m:.3f} / {one.h_m:.3f}",
        )
        ellipsoids.add_row(
            one.fix_class,
            f"{one.ellipsoid.alpha_m:.3f}",
            f"{one.ellipsoid.beta_m:.3f}",
            f"{one.correlation_s:.0f}",
        )
        if one.memory is not None:
            memory = (f"{value:.3g}" for value in asdict(one.memory).values())
            memories.add_row(one.fix_class, *memory, str(one.changes))
    return [cylinders, ellipsoids, memories]


def plot_survey(survey: Survey, out: Path) -> None:
    """Plot the errors of every class, Figs 10 and 11 of Kume 2010: from above with r, over time with h."""
    from matplotlib.figure import Figure  # noqa: PLC0415  (slow to import, and only plots need it)

    if not survey.classes:
        raise GpsLogError("no fix class to plot")
    figure = Figure(figsize=(9.0, 3.6 * len(survey.classes)), layout="constrained")
    axes = figure.subplots(len(survey.classes), 2, squeeze=False)
    for (above, height), one in zip(axes, survey.classes, strict=True):
        rows = [name is one.fix_class for name in survey.fix_class]
        errors, colour = survey.errors_m[rows], _COLOURS.get(one.fix_class, "#5a6acf")
        above.plot(errors[:, 0], errors[:, 1], ".", color=colour, ms=4, alpha=0.6)
        above.add_patch(_circle(one.r_m))
        above.plot(0, 0, "k+", ms=10)
        above.set(xlabel="east [m]", ylabel="north [m]", title=f"{one.fix_class}, r = {one.r_m:.3f} m")
        above.set_aspect("equal", adjustable="datalim")
        height.plot(survey.t_s[rows], errors[:, 2], ".", color=colour, ms=4, alpha=0.6)
        height.axhspan(-one.h_m, one.h_m, color="k", alpha=0.08)
        height.set(xlabel="time [s]", ylabel="up [m]", title=f"{one.epochs} epochs, h = {one.h_m:.3f} m")
    with new_file(out) as scratch:
        figure.savefig(scratch, dpi=110, format=_format(out) or "png")


def _circle(radius: float) -> object:
    from matplotlib.patches import Circle  # noqa: PLC0415

    return Circle((0.0, 0.0), radius, fill=False, color="k", lw=1.2)
