"""Markdown tables."""

from collections.abc import Iterable, Sequence


def header(columns: Sequence[str]) -> str:
    """Return the two lines that begin a table."""
    return f"{row(columns)}\n{'|---' * len(columns)}|"


def row(cells: Iterable[str]) -> str:
    """Return one line of a table."""
    return f"| {' | '.join(cells)} |"


def table(columns: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a whole table."""
    return "\n".join([header(columns), *map(row, rows)])


def mean_and_range(values: Sequence[float], digits: int = 3, middle: float | None = None) -> str:
    """Return ``mean (least-most)``, or the value alone if there is only one; ``middle`` replaces the mean."""
    middle = sum(values) / len(values) if middle is None else middle
    if len(values) == 1:
        return f"{middle:.{digits}f}"
    return f"{middle:.{digits}f} ({min(values):.{digits}f}-{max(values):.{digits}f})"
