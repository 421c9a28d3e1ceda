"""Self-contained HTML pages: a common template, figures embedded in the page."""

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vgps.writers.atomic import new_file


def write_page(package: str, values: Mapping[str, Any], out: Path) -> None:
    """Render ``page.html.j2`` of a package, which extends ``base.html.j2`` of this one, to a file.

    Args:
        package: Dotted name of the package with the template.
        values: The template's variables.
        out: The HTML file.

    Raises:
        RunFolderError: ``out`` is a folder, or cannot be written.
    """
    templates = ChoiceLoader([PackageLoader(package, ""), PackageLoader("vgps.writers", "")])
    environment = Environment(
        loader=templates, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    html = environment.get_template("page.html.j2").render(values)
    with new_file(out) as scratch:
        scratch.write_text(html, encoding="utf-8")


def embedded(figure: Figure) -> str:
    """Return a figure as a data URI for an ``img``: SVG, the same bytes for the same figure."""
    stream = io.BytesIO()
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "vgps", "font.family": "sans-serif"}):
        figure.savefig(stream, format="svg", dpi=150, metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(stream.getvalue()).decode("ascii")


def tidy(*many: Axes) -> None:
    """Style axes alike: a light grid, no box, legible numbers."""
    for axes in many:
        axes.grid(alpha=0.25, lw=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=8)
        for label in (axes.xaxis.label, axes.yaxis.label):
            label.set_fontsize(9)
