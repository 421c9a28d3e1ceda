"""Which GPS model gives the smallest error on a recording with truth, by log and seed?

Mean unaligned error of the camera; a front end run per log and seed, stage D for every model, as in ``vgps
compare``. The median over seeds and its range.
"""

import statistics
from pathlib import Path

import vgps
from scripts.common.command import ScriptParser, add_recording_and_logs, add_seeds
from scripts.common.markdown import mean_and_range, table
from vgps.cli.terminal import TerminalProgress
from vgps.compare import METHODS, compare


def main() -> None:
    """Print a markdown table, a row per model."""
    parser = ScriptParser("experiments.models", __doc__)
    add_recording_and_logs(parser)
    add_seeds(parser, 1)
    parser.add_argument("--survey", type=Path, help="regions of the fix classes")
    given = parser.parse_args()
    errors_m: dict[tuple[str, str], list[float]] = {}
    with parser.refusals():
        results = parser.results(given)
        for log in given.logs:
            recording = vgps.open_recording(given.recording, gps=log)
            for seed in range(given.seeds):
                config = vgps.Config(seed=seed).with_gps(None, given.survey)
                found = compare(recording, given.recording / "truth.tum", config, TerminalProgress())
                for name, evaluation in found.evaluations.items():
                    size = evaluation.camera_position_m
                    errors_m.setdefault((name, log), []).append(size.mean)
                    results.add(model=name, log=log, seed=seed, mean_m=size.mean, max_m=size.max)

    def cell(errors: list[float]) -> str:
        return mean_and_range(errors, middle=statistics.median(errors))

    rows = ([method.name, *(cell(errors_m[method.name, log]) for log in given.logs)] for method in METHODS)
    print(table(["model", *given.logs], rows))


if __name__ == "__main__":
    main()
