"""Evaluations as tables for people and as JSON for scripts."""

from collections.abc import Sequence
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from vgps.evaluation.metrics import ErrorStatistics, Evaluation

_STATISTICS = tuple(item.name for item in fields(ErrorStatistics))
_ROWS = (
    ("camera position [m]", "camera_position_m"),
    ("  horizontal [m]", "camera_horizontal_m"),
    ("  vertical [m]", "camera_vertical_m"),
    ("antenna position [m]", "antenna_position_m"),
    ("  horizontal [m]", "antenna_horizontal_m"),
    ("  vertical [m]", "antenna_vertical_m"),
    ("rotation [deg]", "rotation_deg"),
    ("camera, SE(3)-aligned [m]", "camera_position_after_se3_m"),
    ("camera, Sim(3)-aligned [m]", "camera_position_after_sim3_m"),
)
_COLUMNS = (
    "frames",
    "camera\nmean",
    "camera\nmax",
    "antenna\nmean",
    "antenna\nstd",
    "antenna\nmax",
    "angle\nmean",
    "SE(3)\nmean",
    "NEES",
)


def to_json(evaluation: Evaluation) -> dict[str, Any]:
    """Convert an evaluation to JSON types, with units in the keys and without the per-frame arrays."""
    return {
        item.name: _plain(getattr(evaluation, item.name))
        for item in fields(evaluation)
        if not isinstance(getattr(evaluation, item.name), np.ndarray)
    }


def evaluation_table(evaluation: Evaluation, title: str | None = None) -> Table:
    """Return a table of all errors; they are unaligned unless the row says otherwise."""
    rendered = Table(title=_escaped(title), caption_justify="left")
    rendered.caption = escape("\n".join(_footnotes(evaluation)))
    rendered.add_column("error")
    for statistic in _STATISTICS:
        rendered.add_column(statistic, justify="right")
    for label, name in _ROWS:
        statistics: ErrorStatistics | None = getattr(evaluation, name)
        if statistics is not None:
            rendered.add_row(
                escape(label), *(f"{getattr(statistics, statistic):.3f}" for statistic in _STATISTICS)
            )
    return rendered


def comparison_table(evaluations: Sequence[tuple[str, Evaluation]], title: str | None = None) -> Table:
    """Return a table with a row per named evaluation; it fits 80 columns with names of up to 16."""
    rendered = Table(
        title=_escaped(title), box=SIMPLE_HEAD, padding=(0, 0), pad_edge=False, caption_justify="left"
    )
    rendered.caption = "metres, rotation angle in degrees; unaligned except for the column SE(3)"
    rendered.add_column("name", overflow="fold")
    for column in _COLUMNS:
        rendered.add_column(column, justify="right", no_wrap=True)
    for name, e in evaluations:
        aligned = e.camera_position_after_se3_m
        rendered.add_row(
            escape(name),
            f"{e.frames_matched}/{e.frames_truth}",
            f"{e.camera_position_m.mean:.3f}",
            f"{e.camera_position_m.max:.3f}",
            f"{e.antenna_position_m.mean:.3f}",
            f"{e.antenna_position_m.std:.3f}",
            f"{e.antenna_position_m.max:.3f}",
            f"{e.rotation_deg.mean:.3f}",
            "" if aligned is None else f"{aligned.mean:.3f}",
            "" if e.nees is None else f"{e.nees.mean:.2f}",
        )
    return rendered


def _escaped(title: str | None) -> str | None:
    return None if title is None else escape(title)  # rich would read [m] as markup


def _footnotes(e: Evaluation) -> list[str]:
    missing = e.frames_truth - e.frames_matched
    posed = "every frame has a pose" if e.every_frame_posed else f"{missing} frames have no pose"
    lines = [
        f"{e.frames_matched} of {e.frames_truth} frames of the truth matched, {posed}; "
        f"{e.frames_estimate} frames in the estimate; time difference at most {e.largest_gap_s:.4f} s "
        f"(limit {e.tolerance_s:.4f} s), nothing interpolated"
    ]
    if e.sim3_scale is not None:
        lines.append(f"scale of the Sim(3) alignment: {e.sim3_scale:.5f}")
    if e.nees is not None:
        lines.append(
            f"position NEES {e.nees.mean:.2f} (3 if the stated standard deviations are right), "
            f"{100 * e.nees.within_95:.0f} % of frames within the 95 % bound"
        )
    return [*lines, *e.notes]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(value)
    return asdict(value) if hasattr(value, "__dataclass_fields__") else value
