"""Benchmarks of growth: every length in a process of its own, whose peak memory is that of this length."""

import argparse
import json
import subprocess
import sys
from collections.abc import Callable

from scripts.common.command import ScriptParser
from scripts.common.markdown import growth_table
from vgps.errors import RunFolderError

Figures = dict[str, float]  # by name with unit, the length as ``frames``


def measure_lengths(
    parser: ScriptParser, lengths: str, one_length: Callable[[argparse.Namespace, int], Figures]
) -> None:
    """Print the table of a benchmark, again after every length, for the last may take long.

    Args:
        parser: Arguments of the benchmark.
        lengths: Name of the one with the lengths.
        one_length: Measures one of them in this process.
    """
    parser.add_argument("--one", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    with parser.refusals():
        if given.one:
            print(json.dumps(one_length(given, given.one)))
            return
        results, runs = parser.results(given), []
        for length in getattr(given, lengths):
            runs.append(_in_its_own_process(length))
            results.add(**runs[-1])
            print(growth_table(runs) + "\n", flush=True)


def _in_its_own_process(length: int) -> Figures:
    """Run this command for one length in a new process.

    Raises:
        RunFolderError: It failed; it has said why.
    """
    words = [sys.executable, *sys.orig_argv[1:], "--one", str(length)]
    done = subprocess.run(words, check=False, stdout=subprocess.PIPE, text=True)
    if done.returncode:
        raise RunFolderError(f"--one {length} ended with exit code {done.returncode}")
    figures: Figures = json.loads(done.stdout.splitlines()[-1])
    return figures
