"""Delimited text with named columns, read by all CSV readers."""

import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

import numpy as np

from vgps.errors import VgpsError
from vgps.model import FloatArray, IntArray

_UNIT = re.compile(r"_?\((m|s|deg|°)\)$")  # that of the columns read here, behind their names
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")
_LARGEST_BYTES = 1_000_000_000
"""Size of a file from which on it is not read at once: a log of a day is far smaller."""


def read_bytes(path: Path, error: type[VgpsError]) -> bytes:
    """Return the file's content; raise ``error`` if it is missing, unreadable, empty or huge."""
    try:
        size = path.stat().st_size
        if size > _LARGEST_BYTES:
            raise error(
                f"{size / 1e9:.1f} GB",
                file=path,
                expected=f"at most {_LARGEST_BYTES / 1e9:g} GB",
                remedy="cut it to the time of the video",
            )
        data = path.read_bytes()
    except OSError as problem:
        raise error(f"cannot be read ({problem.strerror})", file=path) from problem
    if not data.strip():
        raise error("the file is empty", file=path)
    return data


def first_unordered(t_s: FloatArray) -> int | None:
    """Return the first row that is not finite or not later than the row before; None if there is none."""
    good = np.isfinite(t_s)
    good[1:] &= t_s[1:] > t_s[:-1]
    return None if good.all() else int(np.argmin(good))


@dataclass(frozen=True, kw_only=True)
class Table:
    """Rows of text under named columns.

    Attributes:
        path: The file.
        error: Class of the errors to raise.
        columns: Column names, lower case, without spaces and units in brackets, in the file's order.
        cells: (N,) rows, each as long as ``columns``.
        line: (N,) line of the file (from 1) of each row.
        short_lines: Lines omitted for having too few cells.
    """

    path: Path
    error: type[VgpsError]
    columns: tuple[str, ...]
    cells: list[list[str]]
    line: IntArray
    short_lines: tuple[int, ...]

    def find(self, *names: str) -> str | None:
        """Return the first of the names that is a column, if any."""
        return next((name for name in names if name in self.columns), None)

    def like(self, *names: str, but: Collection[str] = ()) -> str | None:
        """Return a column that may be one of the names misspelt, and is none of those of others, if any."""
        columns = [column for column in self.columns if column not in but]
        return next((near for name in names for near in get_close_matches(name, columns, 1, 0.7)), None)

    def require(self, *names: str, values: str = "", but: Collection[str] = ()) -> str:
        """Return the first of the names that is a column, or raise ``error`` with a likely misspelling.

        Args:
            names: Names of the column.
            values: What it holds, for the message.
            but: Columns that are none of these, however alike.
        """
        found = self.find(*names)
        if found is not None:
            return found
        close = self.like(*names, but=but)
        raise self.error(
            f"no column {names[0]} among {', '.join(self.columns)}",
            file=self.path,
            place=f"line {self.header_line}",
            remedy=f"did you mean {close}? Rename it to {names[0]}"
            if close
            else f"add a column {names[0]}{values and f' ({values})'}",
        )

    @property
    def header_line(self) -> int:
        """Line of the column names, for messages."""
        return max(1, int(self.line[0]) - 1) if len(self.line) else 1

    def text(self, name: str) -> list[str]:
        """Return the (N,) cells of a column."""
        index = self.columns.index(name)
        return [row[index] for row in self.cells]

    def numbers(self, name: str, *, lenient: bool = False) -> FloatArray:
        """Return the (N,) numbers of a column, empty cells as NaN.

        Raises:
            VgpsError: Of the table's class; a cell is not a number. If ``lenient``, such a cell is NaN.
        """
        return np.array([self._number(cell, row, name, lenient) for row, cell in enumerate(self.text(name))])

    def _number(self, cell: str, row: int, name: str, lenient: bool) -> float:
        try:
            return float(cell or "nan")
        except ValueError:
            if lenient:
                return np.nan
            raise self.error(
                f"{cell!r} in column {name}",
                file=self.path,
                place=f"line {self.line[row]}",
                expected="a number",
            ) from None


def read_table(path: Path, error: type[VgpsError]) -> Table:
    """Read delimited text whose first line names the columns.

    Cells are separated by commas, or by semicolons or tabs, between which numbers may have decimal commas;
    ``#`` starts a comment line.

    Raises:
        VgpsError: Of the given class; the file is missing, empty or has no line of column names.
    """
    text = read_bytes(path, error).decode("utf-8-sig", errors="replace").replace("\0", "")
    numbered = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise error("only comments", file=path, expected="a line of column names, then rows")
    delimiter = _delimiter(numbered[0][1])
    try:
        rows = list(csv.reader((line for _, line in numbered), delimiter=delimiter, strict=False))
    except csv.Error as problem:
        raise error(
            f"not a table ({problem})", file=path, expected="rows of cells separated by commas"
        ) from problem
    columns = tuple(_normal(cell) for cell in rows[0])
    twice = [name for name, count in Counter(columns).items() if count > 1 and name]
    if twice:
        raise error(f"column {twice[0]} appears twice", file=path, place=f"line {numbered[0][0]}")
    # a quoted line break merges rows; the pairing then ends with the shorter list
    paired = [
        (number, [cell.strip() for cell in row])
        for (number, _), row in zip(numbered[1:], rows[1:], strict=False)
    ]
    if delimiter != ",":
        paired = [(number, [_with_point(cell) for cell in row]) for number, row in paired]
    whole = [(number, row) for number, row in paired if len(row) >= len(columns)]
    short = tuple(number for number, row in paired if len(row) < len(columns))
    line = np.array([number for number, _ in whole], np.int64)
    return Table(
        path=path, error=error, columns=columns, cells=[row for _, row in whole], line=line, short_lines=short
    )


def read_samples(
    path: Path, names: Sequence[str], error: type[VgpsError]
) -> tuple[FloatArray, FloatArray, int]:
    """Read the samples of a sensor: column ``t_s`` and those of the names (k).

    Returns:
        Times (N,) in strict order, values (N, k), and the number of rows left out: those that are not finite
        or have the time of an earlier row.

    Raises:
        VgpsError: Of the given class; the file is missing or empty, a column is missing, a cell is not a
            number, or there are fewer than two samples.
    """
    table = read_table(path, error)
    values = np.column_stack([table.numbers(table.require(name)) for name in ("t_s", *names)])
    good = values[np.isfinite(values).all(axis=1)]
    times, rows = np.unique(good[:, 0], return_index=True)
    if len(times) < 2:
        raise error(f"{len(times)} usable samples", file=path, expected="at least 2")
    return times, good[rows, 1:], len(values) - len(times)


def _with_point(cell: str) -> str:
    """Return a number with a decimal comma, as spreadsheets of many countries write it, with a point."""
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell


def _delimiter(header: str) -> str:
    return max((",", ";", "\t"), key=header.count)


def _normal(name: str) -> str:
    return _UNIT.sub("", name.strip().lower().replace(" ", "_")).removeprefix("field.")
