"""Table 6 of Kume 2010 from comparisons on several recordings or seeds: errors of the antenna, and ratios."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from vgps.compare.methods import METHODS, Comparison


class AntennaError(NamedTuple):
    """Error of the antenna position over all frames, metres."""

    mean_m: float
    std_m: float
    max_m: float


Row = Mapping[str, AntennaError]
"""A comparison's errors by method."""

THESIS: Row = MappingProxyType(
    {
        METHODS[0].name: AntennaError(2.1096, 0.9158, 3.0362),
        METHODS[1].name: AntennaError(1.7870, 1.4973, 4.7425),
        METHODS[2].name: AntennaError(0.8947, 0.5822, 1.6807),
        METHODS[3].name: AntennaError(0.4055, 0.2867, 0.9016),
        METHODS[4].name: AntennaError(0.4060, 0.2618, 0.8442),
    }
)
"""Table 6, Kume 2010."""

_REGIONS, _BASES = (METHODS[3].name, METHODS[4].name), (METHODS[2].name, METHODS[1].name)


@dataclass(frozen=True)
class Ratio:
    """Mean error of one method over that of another.

    Attributes:
        method, base: Names in ``METHODS``.
        of_means: Of the means over all comparisons.
        each: Of every comparison on its own.
        thesis: The thesis's.
    """

    method: str
    base: str
    of_means: float
    each: tuple[float, ...]
    thesis: float


def antenna_errors(comparison: Comparison) -> Row:
    """Mean, standard deviation and maximum of the antenna's error, by method."""
    spreads = {name: one.antenna_position_m for name, one in comparison.evaluations.items()}
    return {name: AntennaError(s.mean, s.std, s.max) for name, s in spreads.items()}


def ratios_to_gaussians(rows: Sequence[Row]) -> list[Ratio]:
    """Ratios of the region models (D, cylinder) to the Gaussians C and B, where these ran."""
    found = []
    for method in _REGIONS:
        for base in _BASES:
            pairs = [(row[method].mean_m, row[base].mean_m) for row in rows if {method, base} <= set(row)]
            if pairs:
                over, under = np.array(pairs).T
                each = tuple(float(x) for x in over / under)
                thesis = THESIS[method].mean_m / THESIS[base].mean_m
                found.append(Ratio(method, base, float(over.mean() / under.mean()), each, thesis))
    return found


def as_markdown(rows: Sequence[Row]) -> str:
    """A table of errors with the thesis's beside them, and one of ratios; ranges are over ``rows``.

    Args:
        rows: One per recording or seed, at least one.
    """
    lines = [
        "| method | mean [m] | std [m] | max [m] | thesis: mean / std / max [m] |",
        "|---|---|---|---|---|",
    ]
    for method in METHODS:
        own = np.array([row[method.name] for row in rows if method.name in row])
        if len(own):
            thesis = THESIS.get(method.name)
            beside = " / ".join(f"{x:.3f}" for x in thesis) if thesis else ""
            cells = [_cell(tuple(column)) for column in own.T]
            lines.append(f"| {method.name} | {' | '.join(cells)} | {beside} |")
    lines += ["", "| ratio of mean errors | of means (range over runs) | thesis |", "|---|---|---|"]
    for ratio in ratios_to_gaussians(rows):
        spread = _range(ratio.each, ratio.of_means)
        lines.append(f"| {ratio.method} to {ratio.base} | {spread} | {ratio.thesis:.2f} |")
    return "\n".join(lines)


def _cell(values: tuple[float, ...]) -> str:
    return _range(values, float(np.mean(values)), digits=3)


def _range(values: tuple[float, ...], middle: float, digits: int = 2) -> str:
    if len(values) == 1:
        return f"{middle:.{digits}f}"
    return f"{middle:.{digits}f} ({min(values):.{digits}f}-{max(values):.{digits}f})"
