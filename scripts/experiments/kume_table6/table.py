"""Errors of the antenna on several recordings or seeds as Table 6 of Kume 2010, and ratios of methods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from scripts.common.markdown import mean_and_range, table
from vgps.compare.methods import METHODS, Comparison


class AntennaError(NamedTuple):
    """Error of the antenna's position over all frames, metres."""

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
        of_means: Ratio of the means over all comparisons.
        each: Ratio in every comparison.
        thesis: Ratio in the thesis.
    """

    method: str
    base: str
    of_means: float
    each: tuple[float, ...]
    thesis: float


def antenna_errors(comparison: Comparison) -> Row:
    """Return mean, standard deviation and maximum of the antenna's error, by method."""
    spreads = {name: one.antenna_position_m for name, one in comparison.evaluations.items()}
    return {name: AntennaError(s.mean, s.std, s.max) for name, s in spreads.items()}


def ratios_to_gaussians(rows: Sequence[Row]) -> list[Ratio]:
    """Return the ratios of the region models (D, cylinder) to the Gaussians C and B, where these ran."""
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
    """Return a table of errors with the thesis's beside them, and one of ratios; ranges are over ``rows``.

    Args:
        rows: One per recording or seed, at least one.
    """
    errors = []
    for method in METHODS:
        own = np.array([row[method.name] for row in rows if method.name in row])
        if len(own):
            thesis = THESIS.get(method.name)
            beside = " / ".join(f"{x:.3f}" for x in thesis) if thesis else ""
            errors.append([method.name, *(mean_and_range(column.tolist()) for column in own.T), beside])
    ratios = [
        [
            f"{ratio.method} to {ratio.base}",
            mean_and_range(ratio.each, digits=2, middle=ratio.of_means),
            f"{ratio.thesis:.2f}",
        ]
        for ratio in ratios_to_gaussians(rows)
    ]
    columns = ["method", "mean [m]", "std [m]", "max [m]", "thesis: mean / std / max [m]"]
    below = table(["ratio of mean errors", "of means (range over runs)", "thesis"], ratios)
    return f"{table(columns, errors)}\n\n{below}"
