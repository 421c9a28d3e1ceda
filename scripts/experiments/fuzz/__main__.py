"""Does any damaged file crash a reader, hang it or fill the memory?

Each reader of ``targets.py`` gets the same number of files, made from those in ``corpus/`` by damage to
bytes, lines, numbers, trees, and to the inside of binary formats whose check sums are then made right. A file
may be accepted, or refused in one line. Everything else is a finding: an exception that is not a VgpsError, a
dead process, more than 5 s of processor time or 1 GB of memory. The number of a finding makes its file again;
one that was repaired moves into ``corpus/``, from where the tests read it.
"""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from scripts.common.command import ScriptParser, add_jobs
from scripts.experiments.fuzz.campaign import Tally, fuzz
from scripts.experiments.fuzz.targets import TARGETS, Target

_CHUNK = 2000  # files per process


def main() -> None:
    """Print a line per reader; exit with code 1 if there is a finding."""
    parser = ScriptParser("experiments.fuzz", __doc__)
    parser.add_argument("--inputs", type=int, default=22_000, help="damaged files over all readers")
    parser.add_argument("--seed", type=int, default=0, help="another seed makes other files")
    parser.add_argument("--targets", nargs="*", default=[], metavar="NAME", help="only these readers")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep the files of findings here")
    add_jobs(parser, "processes")
    given = parser.parse_args()
    known = {target.name: target for target in TARGETS}
    unknown = [name for name in given.targets if name not in known]
    if unknown or given.inputs < 1:
        parser.error(
            f"--targets {unknown[0]}, expected some of {', '.join(known)}" if unknown else "no --inputs"
        )
    chosen = [known[name] for name in given.targets] or list(TARGETS)
    each = -(-given.inputs // len(chosen))
    with parser.refusals():
        results = parser.results(given)
        found = 0
        for target in chosen:
            tally = _fuzz_in_chunks(target, each, given.seed, given.keep, given.jobs)
            found += len(tally.findings)
            row = {name: value for name, value in vars(tally).items() if name != "findings"}
            results.add(reader=target.name, **row, findings=len(tally.findings))
            print(_line(target, tally), flush=True)
            for finding in tally.findings[:5]:
                print(f"    {finding.number}: {finding.kind}: {finding.text}", flush=True)
        results.summarise(findings=found, seed=given.seed)
    sys.exit(1 if found else 0)


def _fuzz_in_chunks(target: Target, inputs: int, seed: int, kept: Path | None, jobs: int) -> Tally:
    chunks = [range(first, min(first + _CHUNK, inputs)) for first in range(0, inputs, _CHUNK)]
    total = Tally()
    with ThreadPoolExecutor(jobs) as pool:
        for tally in pool.map(lambda numbers: fuzz(target, numbers, seed, kept), chunks):
            total.add(tally)
    return total


def _line(target: Target, tally: Tally) -> str:
    return (
        f"{target.name:15} {tally.inputs:8} files: {tally.accepted:7} accepted, {tally.refused:7} refused, "
        f"{len(tally.findings):3} findings; slowest {tally.slowest_s:.2f} s, {tally.largest_mb:.0f} MB, "
        f"{tally.seconds:.0f} s"
    )


if __name__ == "__main__":
    main()
