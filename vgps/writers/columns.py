"""Columns of text as CSV files have them; unknown numbers are empty."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vgps.model import FloatArray

ENU = ("east", "north", "up")
QUATERNION = ("qx", "qy", "qz", "qw")


def numbers(values: npt.NDArray[np.floating], digits: int) -> list[str]:
    """Return numbers (N,) as text with so many decimal places."""
    return [f"{value:.{digits}f}" if np.isfinite(value) else "" for value in values + 0.0]


def named(names: Sequence[str], values: FloatArray, digits: int) -> dict[str, list[str]]:
    """Return the columns (N, k) of an array by their k names."""
    return {name: numbers(column, digits) for name, column in zip(names, values.T, strict=True)}


def enu(name: str, values: FloatArray, digits: int) -> dict[str, list[str]]:
    """Return columns (N, 3) east, north, up; ``{}`` in the name stands for the axis."""
    return named([name.format(axis) for axis in ENU], values, digits)


def write_columns(columns: Mapping[str, Iterable[object]], out: Path) -> None:
    """Write columns of equal length under their names."""
    with out.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*columns.values(), strict=True))
