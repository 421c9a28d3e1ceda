"""How much faster are two workers than one, and what does the loss of a worker cost?

Short simulated walks are smoothed as a list, by one worker and by two, each with one thread and tied to a
core of its own. Then one of two is killed when half of that time has passed. All must have the same bytes.
"""

import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from distributed import LocalCluster

from scripts.common.command import ScriptParser
from scripts.common.markdown import LiveTable
from scripts.common.scenes import small_walk
from scripts.common.stopwatch import stopwatch
from vgps.simulate import simulate
from vgps.writers.run_folder import FILES


@contextmanager
def cluster_of(workers: int) -> Iterator[LocalCluster]:
    """Yield a cluster whose workers have a core each."""
    options = {"threads_per_worker": 1, "dashboard_address": None, "memory_limit": None}
    with LocalCluster(n_workers=workers, **options) as cluster:  # type: ignore[no-untyped-call]
        for core, worker in enumerate(cluster.workers.values()):
            os.sched_setaffinity(worker.pid, {core})  # its children and threads to come have it too
            for thread in Path(f"/proc/{worker.pid}/task").iterdir():
                os.sched_setaffinity(int(thread.name), {core})
        yield cluster


def smoothed(walks: Path, workers: int, kill_after_s: float | None = None) -> tuple[float, dict[str, bytes]]:
    """Smooth the list of walks; return the seconds, and the bytes of all files but the summaries."""
    out = walks / "runs"
    words = [sys.executable, "-m", "vgps", "smooth", str(walks / "list.txt"), "--out", str(out)]
    with cluster_of(workers) as cluster:
        victim = cluster.workers[0].pid
        timer = threading.Timer(kill_after_s or 0.0, lambda: os.kill(victim, signal.SIGKILL))
        if kill_after_s is not None:
            timer.start()
        with stopwatch() as elapsed:
            subprocess.run(
                [*words, "--scheduler", cluster.scheduler_address], check=True, stdout=subprocess.DEVNULL
            )
        timer.cancel()
    names = [name for name in FILES if name != "solution.json"]
    found = {f"{run.name}/{name}": (run / name).read_bytes() for run in out.glob("walk*") for name in names}
    return elapsed.wall_s, found


def main() -> None:
    """Print a row per cluster; exit with code 1 if any file differs."""
    parser = ScriptParser("benchmarks.cluster", __doc__)
    parser.add_argument("--recordings", type=int, default=8, help="number of walks")
    given = parser.parse_args()
    results, columns = parser.results(given), LiveTable("workers", "killed", "s", "speed", "same bytes")
    small = small_walk(0.5)
    with tempfile.TemporaryDirectory() as folder:
        walks = Path(folder)
        for number in range(given.recordings):
            simulate(walks / f"walk{number}", small, seed=number)
        lines = [f"walk{number}\n" for number in range(given.recordings)]
        (walks / "list.txt").write_text("".join(lines), encoding="utf-8")
        alone_s, expected = smoothed(walks, 1)
        two_s, by_two = smoothed(walks, 2)
        lost_s, by_survivor = smoothed(walks, 2, kill_after_s=0.5 * two_s)
    rows = ((1, False, alone_s, expected), (2, False, two_s, by_two), (2, True, lost_s, by_survivor))
    for workers, killed, seconds, found in rows:
        same, speed = found == expected, alone_s / seconds
        columns.add(workers, "one" if killed else "", f"{seconds:.1f}", f"{speed:.2f}", same)
        results.add(workers=workers, killed=killed, seconds=seconds, speed=speed, same_bytes=same)
    sys.exit(0 if all(found == expected for *_, found in rows) else 1)


if __name__ == "__main__":
    main()
