"""``gyro.csv``: angular rates in the sensor's own axes."""

from pathlib import Path

import numpy as np

from vgps.errors import GyroLogError
from vgps.model import GyroLog
from vgps.readers.table import read_table


def read_gyro(path: str | Path, *, video_start_s: float = 0.0) -> GyroLog:
    """Read columns ``t_s, wx_rad_s, wy_rad_s, wz_rad_s``.

    Args:
        path: The file.
        video_start_s: The first frame's time on the file's clock; subtracted.

    Returns:
        Samples in strict order of time, without those that have a NaN or the time of another.

    Raises:
        GyroLogError: The file is missing or empty, a column is missing, a cell is not a number, or there are
            fewer than two samples.
    """
    path = Path(path)
    table = read_table(path, GyroLogError)
    t_s = table.numbers(table.require("t_s"))
    rate = np.column_stack([table.numbers(table.require(f"w{axis}_rad_s")) for axis in "xyz"])
    good = np.isfinite(t_s) & np.isfinite(rate).all(axis=1)
    # the first sample of each time, in order of time
    times, rows = np.unique(t_s[good], return_index=True)
    if len(times) < 2:
        raise GyroLogError(f"{len(times)} usable samples", file=path, expected="at least 2")
    return GyroLog(times - video_start_s, rate[good][rows], path)
