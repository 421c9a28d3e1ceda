"""Faults of a GPS against GPS models: unaligned errors and fixes wrongly refused, as a table and a picture.

Faults are put into a good log by a seeded generator (``vgps/compare/faults.py``): outliers, a cluster,
outages, a clock that is late, a wrong lever arm, a vertical bias, a float solution's wandering. Each fault
has a front end run of its own: stage C looks at the fixes, so one that had seen the good log would hide much
of a fault. The five GPS models share it, and differ in stage D and its verdicts, as in ``vgps compare``. That
front end runs with the cylinder, so the columns say what stage D makes of a fault under each model, not what
a whole run would make of it with a Gaussian from its first frame on. The truth is used for evaluation alone.

The table and the picture are written anew after every fault: a run that is stopped leaves what it has. On the
80 s of kitti03 a fault was measured to take three and a half minutes of processor time on a busy machine, so
all thirteen take three quarters of an hour of it there, and half as long with --jobs 2 on two free cores;
--only runs some.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import matplotlib as mpl

import vgps
from scripts.experiments.fault_matrix.faults import FAULTS
from scripts.experiments.fault_matrix.matrix import Row, as_markdown, matrix_picture, run_fault
from vgps.runtime.progress import Silent
from vgps.writers.atomic import new_file

mpl.use("Agg")


def write(rows: dict[str, Row], out: Path) -> None:
    """The table and the picture of the faults so far."""
    with new_file(out / "fault_matrix.md") as scratch:
        scratch.write_text(as_markdown(rows, FAULTS), encoding="utf-8")
    with new_file(out / "fault_matrix.png") as scratch:
        matrix_picture(rows).savefig(scratch, dpi=110, format="png")


def one(name: str, given: argparse.Namespace) -> Row:
    """One fault, in a process of its own."""
    recording = vgps.open_recording(given.recording, gps=given.gps)
    truth = given.truth or given.recording / "truth.tum"
    config = vgps.Config(seed=given.seed).with_gps(None, given.survey)
    (fault,) = (fault for fault in FAULTS if fault.name == name)
    return run_fault(fault, recording, truth, config, Silent(), given.seed)


def main() -> None:
    """Run the faults asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--recording", type=Path, required=True)
    parser.add_argument("--truth", type=Path, help="by default truth.tum of the recording")
    parser.add_argument("--gps", help="a path, or a name inside the recording")
    parser.add_argument("--out", type=Path, required=True, help="folder for fault_matrix.md and .png")
    parser.add_argument("--only", nargs="+", choices=[fault.name for fault in FAULTS], metavar="FAULT")
    parser.add_argument("--survey", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1, help="faults at a time")
    given = parser.parse_args()
    names = [fault.name for fault in FAULTS if given.only is None or fault.name in given.only]
    rows: dict[str, Row] = {}
    with ProcessPoolExecutor(given.jobs) as pool:
        for name, row in zip(names, pool.map(one, names, [given] * len(names)), strict=True):
            rows[name] = row
            print(f"{name}: done, {len(rows)} of {len(names)}", flush=True)
            write(rows, given.out)
    print(as_markdown(rows, FAULTS))


if __name__ == "__main__":
    main()
