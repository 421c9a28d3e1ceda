"""The verb ``evaluate``."""

import json
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.console import Console


def evaluate(
    run: Path,
    *,
    truth: Path,
    crs: str | None = None,
    geoid: str | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Compute the errors of a run against a truth, unaligned and aligned.

    Args:
        run: Run folder.
        truth: TUM file of world_T_camera in ENU; a rig.yaml beside it may give its origin and clock.
        crs: Coordinate system of the truth, if not ENU: easting, northing, height, and rotations about these.
        geoid: What the truth's heights are above: egm96, a grid file, or metres; by default the ellipsoid.
        as_json: Print JSON instead of a table.
    """
    from vgps.evaluation import evaluate as evaluate_run
    from vgps.evaluation import evaluation_table, to_json

    evaluation = evaluate_run(run, truth, crs=crs, geoid=geoid)
    if as_json:
        print(json.dumps(to_json(evaluation), indent=2))
    else:
        Console().print(evaluation_table(evaluation, str(run)))
