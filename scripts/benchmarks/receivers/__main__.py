"""Is the default at least as good as the fixes themselves and the Gaussian, whatever the receiver?

A cell is a recording with truth, a source of GPS errors and a seed. Sources are the logs that ship with a
recording (``logs``), and errors of real receivers replayed on the true path of the antenna, a stretch that
the seed chooses, with the classes and sigmas that the receiver stated: one standing still (``survey_fix``,
``survey_float``, and ``survey_mixed`` with RTK-fix at both ends), a moving car's Septentrio with its changes
of class, a moving car's u-blox, and kinematic RTK against a better solution (``rtk_drive``,
``rtk_drive_mixed``). The seed also feeds vgps. The models share one front end, run with the default model.

Errors are unaligned: of the camera centre over all frames, and of the fixes at their time stamps against the
interpolated true antenna. The default is worse in a cell if its mean error is above 1.05 times the better of
the fixes and ``gaussian-receiver``, and not below 0.05 m. A fix is wrong if its error is beyond three times
the default region of its class and beyond five of its stated sigmas; good if within three times the region;
refused if rejected or down-classed; missed if neither. Known delays of time stamps are no errors here. NEES
is per axis, 1 if the sigmas are right; cells count by their independent samples, duration over the
correlation time of the error in sigmas, at least one.

The default regions come from ``survey``, and the simulator's own logs imitate it: these cells are marked as
seen, and summed up apart from the others.

The constants of the errors with memory were chosen in view of these receivers, on kitti03 and kitti07: their
cells do not show that they generalise. ``python -m scripts.experiments.receiver_priors`` leaves each
receiver out.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from functools import partial
from pathlib import Path

from scripts.benchmarks.receivers.cells import DEFAULT, MODELS, Cell, Task, run_cell
from scripts.benchmarks.receivers.summary import summaries, worse
from scripts.common.command import ScriptParser, add_jobs, add_seeds
from scripts.common.drives import Drive, open_drive
from scripts.common.markdown import LiveTable, table
from scripts.common.replayed_errors import LOGS, REPLAYED, make_errors, read_series
from vgps.compare.methods import Method
from vgps.errors import GpsLogError
from vgps.runtime.progress import NoProgress

RECORDINGS = ["kitti03", "kitti03:300-600", "kitti07", "walk", "drive"]


def tasks(drives: list[Drive], sources: list[str], seeds: int) -> Iterator[Task]:
    """Yield the cells: replayed sources on every recording, shipped logs on their own."""
    for drive in drives:
        logs = drive.shipped()
        for source in sources:
            names = list(logs) if source == LOGS else [source] if source in {*logs, *REPLAYED} else []
            yield from (Task(drive.name, name, seed) for name in names for seed in range(seeds))


def run(task: Task, data: Path, scenes: Path, models: Sequence[Method]) -> Cell:
    """Run one cell, in a process of its own."""
    drive = open_drive(task.recording, data, scenes)
    errors = make_errors(task.source, drive, data, task.seed)
    return run_cell(drive, errors, task, models, NoProgress())


def row(cell: Cell, models: Sequence[Method]) -> list[str]:
    """Return a line of the table of cells."""
    means = [f"{cell.mean_m[m.key]:.3f}" if m.key in cell.mean_m else "no result" for m in models]
    counts = cell.counts
    refused = counts.good_rtk_fix_refused + counts.good_other_refused
    return [
        f"{cell.recording}, {cell.source}, {cell.seed}{' (seen)' if cell.seen else ''}",
        f"{cell.fixes_mean_m:.3f} / {cell.fixes_max_m:.2f}",
        *means,
        f"{cell.ratio:.2f}{' worse' if worse(cell) else ''}",
        f"{cell.nees:.2f} of {cell.samples:.0f}",
        f"{refused} of {counts.good_rtk_fix + counts.good_other}",
        f"{counts.wrong_missed} of {counts.wrong}",
    ]


def text(value: object) -> str:
    """Return a figure of the summary."""
    return "" if value is None else f"{value:.3g}" if isinstance(value, float) else str(value)


def arguments(parser: ScriptParser) -> argparse.Namespace:
    """Parse the command line."""
    parser.add_argument(
        "--recordings",
        nargs="+",
        default=RECORDINGS,
        metavar="NAME",
        help="folders or scenes; NAME:FIRST-LAST",
    )
    parser.add_argument(
        "--sources", nargs="+", default=[LOGS, *REPLAYED], metavar="SOURCE", help="or files of the recordings"
    )
    parser.add_argument(
        "--models",
        nargs="+",
        default=[one.key for one in MODELS],
        choices=[one.key for one in MODELS],
        help="of the fixes; all by default, the default model always",
    )
    add_seeds(parser, 5)
    add_jobs(parser, "cells")
    data = Path(os.environ.get("VGPS_DATA", "../shared/data"))
    parser.add_argument("--data", type=Path, default=data, help="recordings and receivers' logs")
    parser.add_argument(
        "--scenes", type=Path, help="folder that keeps simulated recordings, for a second run"
    )
    return parser.parse_args()


def main() -> None:
    """Print a markdown table of the cells, and one of their summaries."""
    parser = ScriptParser("benchmarks.receivers", __doc__)
    given = arguments(parser)
    models = [one for one in MODELS if one.key in {DEFAULT, *given.models}]
    cells: list[Cell] = []
    live = LiveTable(
        *("recording, source, seed", "fixes: mean / max [m]", *(f"{m.key} [m]" for m in models)),
        *("cylinder over better", "NEES of samples", "good refused", "wrong missed"),
    )
    with parser.refusals(), tempfile.TemporaryDirectory() as scratch:
        results, scenes = parser.results(given), given.scenes or Path(scratch)
        drives = [open_drive(name, given.data, scenes) for name in given.recordings]
        for source in given.sources:
            check_source(source, drives, given.data)
        todo = list(tasks(drives, given.sources, given.seeds))
        with ProcessPoolExecutor(given.jobs) as pool:
            of_task = partial(run, data=given.data, scenes=scenes, models=models)
            for number, cell in enumerate(pool.map(of_task, todo), 1):
                cells.append(cell)
                print(f"cell {number} of {len(todo)}", file=sys.stderr)
                live.add(*row(cell, models))
                results.add(**asdict(cell) | {"ratio": cell.ratio, "worse": worse(cell)})
        figures = summaries(cells)
        results.summarise(**figures)
    names = list(next(iter(figures.values()), {}))
    print()
    print(table(["", *figures], ([name, *(text(one[name]) for one in figures.values())] for name in names)))


def check_source(source: str, drives: list[Drive], data: Path) -> None:
    """Raise GpsLogError if a source is not there."""
    if source in REPLAYED:
        read_series(source, data)
    elif source != LOGS and not any(source in drive.shipped() for drive in drives):
        known = ", ".join([LOGS, *REPLAYED])
        raise GpsLogError(
            f"no source {source}", expected=f"{known}, or a log of a recording", place="--sources"
        )


if __name__ == "__main__":
    main()
