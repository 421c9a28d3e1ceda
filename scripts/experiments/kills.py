"""Is anything half-written after a kill at any moment, and is a resumed run that of an undisturbed one?

``smooth --resume``, ``landmarks build``, ``join --resume`` and ``online`` run on a small simulated
recording and are ended after a random time by SIGKILL, SIGTERM or SIGINT. After each kill the output is
absent or complete, and no other file has appeared beside it, but for hidden ones, which the next run
removes. After every few kills a run may end, and its files are compared with those of an undisturbed
one: all bytes but the seconds must be equal. Ctrl-C before the first line of vgps gives the traceback of
Python's own start.
"""

import json
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scripts.common.command import ScriptParser
from scripts.common.scenes import small_walk
from vgps.landmarks.info import database_info
from vgps.readers.run_files import run_folders
from vgps.readers.run_folder import read_run
from vgps.simulate import simulate

_SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
_EXPECTED = {
    0: "done",
    130: "interrupted",
    143: "terminated",
    -signal.SIGKILL: "killed",
    -signal.SIGTERM: "terminated",  # before the first line of vgps
    -signal.SIGINT: "interrupted",
}
_BAD_INPUT = 2  # too little had been seen for a run folder
_KILLS_PER_RUN = 4
_LONGEST_S = 120.0  # from the signal to the end
# a clock that runs a hundred times as fast, so that these short runs have several checkpoints
_RUN = (
    "import time; clock = time.monotonic; time.monotonic = lambda: 100 * clock()\n"
    "from vgps.__main__ import main; main()"
)


@dataclass(kw_only=True)
class Verb:
    """A verb, its output, how a complete one is recognised, and whether Ctrl-C writes what there is."""

    name: str
    words: tuple[str, ...]
    out: str
    check: Callable[[Path], object]
    ends_early: bool = False
    seconds: float = 0.0
    reference: dict[str, bytes] = field(default_factory=dict)


def verbs(recording: Path, run: Path, again: Path) -> list[Verb]:
    """Return the verbs that run for long, on a recording, its run and a copy of this run."""
    return [
        Verb(name="smooth", words=("smooth", str(recording), "--resume"), out="run", check=read_run),
        Verb(
            name="landmarks build", words=("landmarks", "build", str(run)), out="db.vgps", check=database_info
        ),
        Verb(name="join", words=("join", str(run), str(again), "--resume"), out="joined", check=read_joined),
        Verb(
            name="online",
            words=("online", str(recording), "--finish"),
            out="live",
            check=read_run,
            ends_early=True,
        ),
    ]


def started(verb: Verb, folder: Path) -> "subprocess.Popen[bytes]":
    """Start a verb in a folder."""
    words = [sys.executable, "-X", "faulthandler", "-c", _RUN, *verb.words, "--out", str(folder / verb.out)]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def read_joined(out: Path) -> None:
    """Read the runs of a folder of joined runs."""
    for folder in run_folders(out):
        read_run(folder)


def contents(path: Path) -> dict[str, bytes]:
    """Return the bytes of an output, without the seconds, which vary."""
    if path.is_file():
        return {path.name: path.read_bytes()}
    files = [file for file in sorted(path.rglob("*")) if file.is_file()]
    found = {str(file.relative_to(path)): file.read_bytes() for file in files}
    for name in [name for name in found if Path(name).name == "solution.json"]:
        found[name] = json.dumps({**json.loads(found[name]), "seconds": None}).encode()
    return found


def faults_after(verb: Verb, folder: Path, code: int, stderr: str) -> list[str]:
    """Return what is wrong after a kill."""
    faults = []
    if code not in _EXPECTED and not (verb.ends_early and code == _BAD_INPUT):
        faults.append(f"exit code {code}: {stderr[-200:]}")
    begun = code != -signal.SIGINT or ", in main\n" in stderr
    if "Traceback" in stderr and begun:
        faults.append(f"traceback: {stderr[-200:]}")
    visible = {path.name for path in folder.iterdir() if not path.name.startswith(".")}
    if visible - {verb.out}:
        faults.append(f"left behind: {visible - {verb.out}}")
    out = folder / verb.out
    if out.exists():
        verb.check(out)
    if out.exists() and not verb.ends_early and contents(out) != verb.reference:
        faults.append("the output is not that of an undisturbed run")
    return faults


def kill(verb: Verb, folder: Path, rng: random.Random) -> tuple[str, list[str]]:
    """Run a verb, end it at a random moment, and return how it ended and what is wrong."""
    process = started(verb, folder)
    time.sleep(rng.uniform(0.0, 1.1 * verb.seconds))
    process.send_signal(rng.choice(_SIGNALS))
    try:
        _, stderr = process.communicate(timeout=_LONGEST_S)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGABRT)  # faulthandler prints where every thread is
        _, stderr = process.communicate()
        return "hangs", [f"hangs: {stderr.decode(errors='replace')}"]
    code = process.returncode
    return _EXPECTED.get(code, "other"), faults_after(verb, folder, code, stderr.decode(errors="replace"))


def resumed(verb: Verb, folder: Path) -> list[str]:
    """Run a verb to its end, and return what is wrong with its output."""
    process = started(verb, folder)
    _, stderr = process.communicate(timeout=600)
    if process.returncode:
        return [f"the resumed run failed: {stderr.decode(errors='replace')[-200:]}"]
    faults = faults_after(verb, folder, 0, "")
    if contents(folder / verb.out) != verb.reference:
        faults.append("the resumed run is not that of an undisturbed one")
    hidden = [path.name for path in folder.iterdir() if path.name.startswith(".")]
    return [*faults, *([f"left behind: {hidden}"] if hidden else [])]


def main() -> None:
    """Print a line per verb; exit with code 1 if anything is wrong."""
    parser = ScriptParser("experiments.kills", __doc__)
    parser.add_argument("--kills", type=int, default=200, help="kills over all verbs")
    parser.add_argument("--seed", type=int, default=0, help="another seed kills at other moments")
    given = parser.parse_args()
    # a shell ignores Ctrl-C for what it starts in the background, and children inherit that
    signal.signal(signal.SIGINT, signal.default_int_handler)
    results = parser.results(given)
    rng, wrong = random.Random(given.seed), 0
    with tempfile.TemporaryDirectory() as scratch:
        recording, run, again = (Path(scratch) / name for name in ("recording", "run", "again"))
        small = small_walk(0.5)
        simulate(recording, small, seed=3)
        every = verbs(recording, run, again)
        if started(every[0], Path(scratch)).wait() != 0:
            raise SystemExit("the recording cannot be smoothed")
        shutil.copytree(run, again)
        for verb in every:
            row = _kill_often(verb, Path(scratch) / f"{verb.name} killed", given.kills // len(every), rng)
            wrong += len(row["faults"])
            results.add(**{**row, "faults": len(row["faults"])})
            print(f"{verb.name:16} {row}", flush=True)
        results.summarise(faults=wrong)
    sys.exit(1 if wrong else 0)


def _kill_often(verb: Verb, folder: Path, kills: int, rng: random.Random) -> dict[str, Any]:
    folder.mkdir()
    begun = time.monotonic()
    faults = [] if started(verb, folder).wait(timeout=600) == 0 else ["the undisturbed run failed"]
    verb.seconds, verb.reference = time.monotonic() - begun, contents(folder / verb.out)
    endings: Counter[str] = Counter()
    for number in range(kills):
        if number % _KILLS_PER_RUN == 0:
            for entry in folder.iterdir():
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        ending, found = kill(verb, folder, rng)
        endings[ending] += 1
        faults += found
        if number % _KILLS_PER_RUN == _KILLS_PER_RUN - 1:
            faults += resumed(verb, folder)
    return {"verb": verb.name, "kills": kills, "seconds": round(verb.seconds, 2), **endings, "faults": faults}


if __name__ == "__main__":
    main()
