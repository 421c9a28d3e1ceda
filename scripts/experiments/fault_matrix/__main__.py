"""How much do faults of a GPS receiver hurt each GPS model, and are wrong fixes found?

Faults are put into a good log by a seeded generator (``faults.py``): outliers, a cluster, outages, a late
clock, a wrong lever arm, a vertical bias, wrong integers, a wandering float solution. Each has a front end
run of its own: stage C uses the fixes, so that one that had seen the good log would hide much of a fault. The
GPS models share it and differ in stage D and its verdicts, as in ``vgps compare``. It runs with the cylinder,
so the columns say what stage D makes of a fault under each model, not what a whole run with that model would.
The truth is used for evaluation alone.

Table and picture are written after every fault: a run that is stopped leaves what it has. On the 80 s of
kitti03 a fault takes about three and a half minutes of processor time, all of them under an hour of it.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

import matplotlib as mpl

import vgps
from scripts.common.command import ScriptParser, add_jobs
from scripts.experiments.fault_matrix.faults import FAULTS
from scripts.experiments.fault_matrix.matrix import Row, as_markdown, matrix_picture, run_fault
from vgps.runtime.progress import NoProgress
from vgps.writers.atomic import new_file

mpl.use("Agg")


def write(rows: dict[str, Row], out: Path) -> None:
    """Write the table and the picture of the faults so far."""
    with new_file(out / "fault_matrix.md") as scratch:
        scratch.write_text(as_markdown(rows, FAULTS), encoding="utf-8")
    with new_file(out / "fault_matrix.png") as scratch:
        matrix_picture(rows).savefig(scratch, dpi=110, format="png")


def one(name: str, given: argparse.Namespace) -> Row:
    """Run one fault, in a process of its own."""
    recording = vgps.open_recording(given.recording, gps=given.gps)
    truth = given.truth or given.recording / "truth.tum"
    config = vgps.Config(seed=given.seed).with_gps(None, given.survey)
    (fault,) = (fault for fault in FAULTS if fault.name == name)
    return run_fault(fault, recording, truth, config, NoProgress(), given.seed)


def main() -> None:
    """Run the faults asked for."""
    parser = ScriptParser("experiments.fault_matrix", __doc__)
    parser.add_argument("--recording", type=Path, required=True, help="with truth")
    parser.add_argument("--truth", type=Path, help="by default truth.tum of the recording")
    parser.add_argument("--gps", help="a path, or a name inside the recording")
    parser.add_argument("--out", type=Path, required=True, help="folder for fault_matrix.md and .png")
    names = [fault.name for fault in FAULTS]
    parser.add_argument("--only", nargs="+", choices=names, metavar="FAULT", help=", ".join(names))
    parser.add_argument("--survey", type=Path, help="regions of the fix classes")
    parser.add_argument("--seed", type=int, default=0)
    add_jobs(parser, "faults")
    given = parser.parse_args()
    names = [name for name in names if given.only is None or name in given.only]
    rows: dict[str, Row] = {}
    with parser.refusals(), ProcessPoolExecutor(given.jobs) as pool:
        results = parser.results(given)
        for name, row in zip(names, pool.map(one, names, [given] * len(names)), strict=True):
            rows[name] = row
            for model, cell in row.items():
                results.add(fault=name, model=model, **asdict(cell))
            print(f"{name}: done, {len(rows)} of {len(names)}", flush=True)
            write(rows, given.out)
    print(as_markdown(rows, FAULTS))


if __name__ == "__main__":
    main()
