"""``control_points.csv``: points of known position and their observations in frames."""

from pathlib import Path

import numpy as np

from vgps.errors import RecordingError
from vgps.model import ControlPoints
from vgps.readers.table import read_table

ENU = ("east_m", "north_m", "up_m")
GEODETIC = ("latitude_deg", "longitude_deg", "height_m")
_LAST_FRAME = 2**31 - 1


def read_control_points(path: str | Path) -> ControlPoints:
    """Read ``frame, u_px, v_px`` and ``east_m, north_m, up_m`` or ``latitude_deg, longitude_deg, height_m``.

    Raises:
        RecordingError: The file is missing or empty, a column is missing, a cell is not a finite number, or a
            frame is not an index.
    """
    path = Path(path)
    table = read_table(path, RecordingError)
    geodetic = "latitude_deg" in table.columns
    place = GEODETIC if geodetic else ENU
    names = [table.require(name) for name in ("frame", "u_px", "v_px", *place)]
    values = np.column_stack([table.numbers(name) for name in names])
    if len(values) == 0:
        raise RecordingError("no control points", file=path, expected="a row for each observation")
    frame = values[:, 0]
    bad = ~np.isfinite(values).all(axis=1) | (frame < 0) | (frame > _LAST_FRAME) | (np.floor(frame) != frame)
    if geodetic:
        bad |= (np.abs(values[:, 3]) > 90) | (np.abs(values[:, 4]) > 180)
    if bad.any():
        line = table.line[int(np.flatnonzero(bad)[0])]
        raise RecordingError(
            "an impossible observation",
            file=path,
            place=f"line {line}",
            expected=f"a frame index from 0 and finite {', '.join(names[1:])}",
        )
    return ControlPoints(
        frame=frame.astype(np.int64),
        uv_px=values[:, 1:3],
        world_p_point=values[:, 3:],
        geodetic=geodetic,
        source=path,
    )
