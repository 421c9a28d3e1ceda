"""Markdown tables."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise


def header(columns: Sequence[str]) -> str:
    """Return the two lines that begin a table."""
    return f"{row(columns)}\n{'|---' * len(columns)}|"


def row(cells: Iterable[str]) -> str:
    """Return one line of a table."""
    return f"| {' | '.join(cells)} |"


def table(columns: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a whole table."""
    return "\n".join([header(columns), *map(row, rows)])


def growth_table(runs: Sequence[Mapping[str, float]]) -> str:
    """Return a row per figure, a column per run by its ``frames``, then by which factor it grew."""
    lengths = [round(run["frames"]) for run in runs]
    steps = [f"{a} to {b}" for a, b in pairwise(lengths)]
    rows = []
    for name in runs[0]:
        values = [run.get(name, float("nan")) for run in runs]
        growth = [f"x {b / a:.2f}" if a else "-" for a, b in pairwise(values)]
        rows.append([name, *(f"{x:.4g}" for x in values), *growth])
    return table(["", *(f"{n} frames" for n in lengths), *steps], rows)


class LiveTable:
    """A table on standard output, row by row as it comes; its header appears with the first row.

    Args:
        columns: Their names.
        numbers: How cells that are floats are written.
    """

    def __init__(self, *columns: str, numbers: str = ".3f") -> None:
        self._begin, self._numbers = f"{header(columns)}\n", numbers

    def add(self, *cells: str | float) -> None:
        """Print a row."""
        words = (format(x, self._numbers) if isinstance(x, float) else str(x) for x in cells)
        print(self._begin + row(words), flush=True)
        self._begin = ""


def mean_and_range(values: Sequence[float], digits: int = 3, middle: float | None = None) -> str:
    """Return ``mean (least-most)``, or the value alone if there is only one; ``middle`` replaces the mean."""
    middle = sum(values) / len(values) if middle is None else middle
    if len(values) == 1:
        return f"{middle:.{digits}f}"
    return f"{middle:.{digits}f} ({min(values):.{digits}f}-{max(values):.{digits}f})"
