"""The whole pipeline on a simulated recording, as a first look at what vgps does."""

from pathlib import Path

from vgps.config import Config
from vgps.evaluation import Evaluation, evaluate
from vgps.pipeline.offline import smooth
from vgps.readers.recording import open_recording
from vgps.report import write_report
from vgps.runtime.progress import Progress
from vgps.simulate import simulate
from vgps.solution import Solution
from vgps.writers.run_folder import write_run


def demo(out: Path, seed: int, progress: Progress) -> tuple[Solution, Evaluation]:
    """Simulate a recording, smooth it, evaluate the result and write a report.

    Args:
        out: Folder for ``recording``, ``run`` and ``report.html``.
        seed: Of the simulated world, the sensor errors and the front end.
        progress: Where progress is reported.

    Returns:
        The run and its errors against the exact truth.
    """
    recording, run = out / "recording", out / "run"
    progress.stage("simulating a recording")
    simulate(recording, "demo", seed)
    solution = smooth(open_recording(recording), Config(seed=seed), progress)
    write_run(solution, run)
    write_report(solution, out / "report.html")
    return solution, evaluate(solution, recording / "truth.tum")
