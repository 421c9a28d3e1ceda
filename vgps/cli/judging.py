"""Verbs that say how good something is."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console

from vgps.cli.app import app
from vgps.evaluate import as_json, as_table, evaluate_run


@app.command
def evaluate(
    run: Path, *, truth: Path, as_json_text: Annotated[bool, Parameter(name="--json", negative="")] = False
) -> None:
    """Unaligned errors of a run against a truth.

    Args:
        run: Run folder.
        truth: TUM file, world_T_camera in ENU; a rig.yaml beside it names its origin and clock.
        as_json_text: Print JSON instead of a table.
    """
    evaluation = evaluate_run(run, truth)
    if as_json_text:
        print(json.dumps(as_json(evaluation), indent=2))
    else:
        Console().print(as_table(evaluation, str(run)))
