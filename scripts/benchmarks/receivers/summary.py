"""Many cells in a few figures."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from scripts.benchmarks.receivers.cells import DEFAULT, Cell, Counts

WORSE, FINE_M = 1.05, 0.05  # beyond this ratio the default is worse; below this error it is fine anyway
COUNTS = tuple(item.name for item in fields(Counts))


def fine(cell: Cell) -> bool:
    """Whether the default's error is below 0.05 m, whatever the others' are."""
    return cell.mean_m.get(DEFAULT, np.inf) < FINE_M


def worse(cell: Cell) -> bool:
    """Whether the default is worse than the better of fixes and Gaussian, or has no result."""
    return not fine(cell) and not cell.ratio <= WORSE


def summarise(cells: Sequence[Cell]) -> dict[str, Any]:
    """Return the figures of the issue's acceptance over some cells; None where there is nothing to count.

    ``worst_ratio`` is over cells at 0.05 m and more with a result, ``median_ratio_mixed`` over logs with
    RTK-fixes and others, ``nees`` the mean over independent samples of the cells.
    """
    done = [cell for cell in cells if DEFAULT in cell.mean_m]
    rated = [cell for cell in done if not fine(cell)]
    worst = max(rated, key=lambda cell: cell.ratio, default=None)
    mixed = [cell.ratio for cell in done if cell.mixed]
    total = {name: sum(getattr(cell.counts, name) for cell in done) for name in COUNTS}
    return {
        "cells": len(cells),
        "without_result": len(cells) - len(done),
        "worse_share": _share(sum(map(worse, cells)), len(cells)),
        "worst_ratio": None if worst is None else worst.ratio,
        "worst_cell": None if worst is None else f"{worst.recording} {worst.source} {worst.seed}",
        "median_ratio_mixed": float(np.median(mixed)) if mixed else None,
        "good_rtk_fix": total["good_rtk_fix"],
        "rtk_fix_refused_per_1000": _share(1000 * total["good_rtk_fix_refused"], total["good_rtk_fix"]),
        "good_other": total["good_other"],
        "other_refused_per_1000": _share(1000 * total["good_other_refused"], total["good_other"]),
        "wrong": total["wrong"],
        "wrong_missed": total["wrong_missed"],
        **pooled_nees(done),
    }


def pooled_nees(cells: Sequence[Cell]) -> dict[str, Any]:
    """Return the mean NEES of cells, each as often as it has independent samples, and their number."""
    stated = [cell for cell in cells if np.isfinite(cell.nees)]
    samples = sum(cell.samples for cell in stated)
    return {"nees": _share(sum(cell.samples * cell.nees for cell in stated), samples), "samples": samples}


def summaries(cells: Sequence[Cell]) -> dict[str, dict[str, Any]]:
    """Return the figures of all cells, of those of receivers not seen, and of each receiver."""
    groups = {"all": list(cells), "not seen": [cell for cell in cells if not cell.seen]}
    for receiver in dict.fromkeys(cell.receiver for cell in cells):
        groups[receiver] = [cell for cell in cells if cell.receiver == receiver]
    return {name: summarise(group) for name, group in groups.items() if group}


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole else None
