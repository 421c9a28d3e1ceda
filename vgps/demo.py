"""The main job on a recording made on the spot, so that a stranger sees it work."""

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
    """Simulate, smooth, evaluate, report.

    Args:
        out: Gets ``recording``, ``run`` and ``report.html``.
        seed: Of the world, the sensors' errors and the front end.
        progress: Shows how far it is.
    """
    recording, run = out / "recording", out / "run"
    progress.say("simulating a recording")
    simulate(recording, "demo", seed)
    solution = smooth(open_recording(recording), Config(seed=seed), progress)
    write_run(solution, run)
    write_report(solution, out / "report.html")
    return solution, evaluate(solution, recording / "truth.tum")
