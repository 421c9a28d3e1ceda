"""The verb ``demo``."""

from pathlib import Path

from rich.console import Console

from vgps.cli.app import print_line
from vgps.cli.options import Seed
from vgps.cli.smooth import print_summary


def demo(*, out: Path = Path("demo"), seed: Seed = 0) -> None:
    """Simulate a short recording, smooth it, evaluate it against its truth and write a report.

    Args:
        out: Folder for the recording, the run and the report.
        seed: Seed of the simulated world and its GPS errors.
    """
    from vgps.cli.terminal import TerminalProgress
    from vgps.demo import demo as run_demo
    from vgps.evaluation import evaluation_table

    solution, evaluation = run_demo(out, seed, TerminalProgress())
    print_summary(solution, out / "run")
    Console().print(evaluation_table(evaluation, "errors against the simulation's exact truth"))
    print_line(f"recording: {out / 'recording'}\nresults:   {out / 'run'}\nreport:    {out / 'report.html'}")
