"""The folder of joined runs: a run folder for each, all landmarks, and a summary."""

from pathlib import Path
from typing import Any

from vgps.readers.run_files import SCHEMA_VERSION
from vgps.solution import JoinedRuns
from vgps.writers.atomic import new_folder
from vgps.writers.ply import write_ply
from vgps.writers.run_folder import summarise, write_run, write_summary

POINTS, SUMMARY = "points.ply", "solution.json"


def write_joined(joined: JoinedRuns, out: Path) -> None:
    """Write ``out``: a run folder for each run under its name, ``points.ply`` and ``solution.json``.

    Raises:
        RunFolderError: ``out`` has something other than earlier runs, or cannot be written.
    """
    first = joined.solutions[0]
    with new_folder(out, (*joined.names, POINTS, SUMMARY)) as folder:
        for name, solution in zip(joined.names, joined.solutions, strict=True):
            write_run(solution, folder / name)
        write_ply(joined.landmarks, joined.observations, first.world_origin, folder / POINTS)
        write_summary(_summary(joined), folder / SUMMARY)


def _summary(joined: JoinedRuns) -> dict[str, Any]:
    """Return what a run's summary says, of all runs together."""
    parts = [summarise(solution) for solution in joined.solutions]
    counts = {key: sum(part["counts"][key] for part in parts) for key in parts[0]["counts"]}
    counts |= {
        "runs": len(parts),
        "landmarks": len(joined.landmarks.sigma_px),
        "observations": len(joined.observations.frame),
        "submaps": parts[0]["counts"]["submaps"],
        "ties": int(joined.ties.sum()),
    }
    # the adjustment, which the runs share
    kept = ("world_origin", "energy", "iterations", "stop_reason", "submaps", "datum", "versions")
    names = joined.names
    return {
        "schema_version": SCHEMA_VERSION,
        "runs": list(names),
        "counts": counts,
        "ties": [
            {"run": names[row], "earlier": names[column], "frames": int(joined.ties[row, column])}
            for row, column in zip(*joined.ties.nonzero(), strict=True)
        ],
        "seconds": dict(joined.seconds),
        "warnings": list(joined.warnings),
        **{key: parts[0][key] for key in kept},
    }
