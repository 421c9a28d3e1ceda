"""Result files: what was measured, by which command, at which commit, on which machine, when.

A file has one commit and one command; a table or figure is drawn from one file. ``notebooks/results/`` holds
those that the documentation quotes.
"""

import json
import os
import platform
import shlex
import subprocess
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info

from vgps.writers.atomic import check_file, new_file

SCHEMA_VERSION = 1
ROOT = Path(__file__).resolve().parents[2]
CODE = ("vgps", "factors", "scripts")  # what decides a result; other files may differ from the commit


class Results:
    """Rows of one measurement, written to a JSON file as they come.

    Commit and machine are those at the start, before the work.

    Args:
        file: Where to write; None to write nothing.
        question: What the rows answer.

    Raises:
        RunFolderError: The file cannot be written.
    """

    def __init__(self, file: Path | None, question: str) -> None:
        self._file = file
        self._content: dict[str, Any] = {}
        if file is not None:
            check_file(file)
            self._content = {"schema_version": SCHEMA_VERSION, "question": question, **provenance()}
            self._content |= {"summary": {}, "rows": []}

    def add(self, **row: Any) -> None:
        """Add a row: words, counts and numbers whose names carry their units."""
        if self._file is not None:
            self._content["rows"].append(_plain(row))
            self._write(self._file)

    def summarise(self, **figures: Any) -> None:
        """Add figures that hold for the measurement as a whole."""
        if self._file is not None:
            self._content["summary"] |= _plain(figures)
            self._write(self._file)

    def _write(self, file: Path) -> None:
        with new_file(file) as scratch:
            scratch.write_text(json.dumps(self._content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def read_results(file: Path) -> dict[str, Any]:
    """Return what a results file holds."""
    content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return content


def provenance() -> dict[str, Any]:
    """Return command, commit, whether the code differs from it, machine and date."""
    return {
        "command": shlex.join(["python", *sys.orig_argv[1:]]),
        "commit": _git("rev-parse", "HEAD") or "unknown",
        "dirty": bool(_git("status", "--porcelain", "--", *CODE)),
        "machine": machine(),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def machine() -> dict[str, Any]:
    """Return processor, cores, load, and the versions on which figures depend."""
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text().splitlines() if cpuinfo.exists() else []
    models = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    blas = [
        f"{one['internal_api']} {one['version']}, {one['num_threads']} threads"
        for one in threadpool_info()
        if one["user_api"] == "blas"
    ]
    return {
        "cpu": models[0] if models else platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "blas": sorted(set(blas)),
        **{name: version(name) for name in ("numpy", "gtsam", "opencv-python-headless")},
    }


def _git(*words: str) -> str:
    """Return what git prints, or nothing where this is no clone."""
    try:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    except OSError:
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def _plain(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row as JSON has it: numbers with six digits, None where one is not finite."""
    return {name: _plain_value(value) for name, value in row.items()}


def _plain_value(value: Any) -> Any:
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    if isinstance(value, dict):
        return _plain(value)
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain_value(one) for one in value]
    return value if value is None else str(value)
