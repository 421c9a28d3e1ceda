"""``gyro.csv``: angular rates in the sensor's own axes."""

from pathlib import Path

from vgps.errors import GyroLogError
from vgps.model import GyroLog
from vgps.readers.table import read_samples


def read_gyro(path: str | Path, *, video_start_s: float = 0.0) -> GyroLog:
    """Read columns ``t_s, wx_rad_s, wy_rad_s, wz_rad_s``.

    Args:
        path: The file.
        video_start_s: The first frame's time on the file's clock; subtracted.

    Returns:
        Samples in strict order of time, without those that are not finite or have the time of another.

    Raises:
        GyroLogError: The file is missing or empty, a column is missing, a cell is not a number, or there are
            fewer than two samples.
    """
    path = Path(path)
    t_s, rate_rad_s, _ = read_samples(path, [f"w{axis}_rad_s" for axis in "xyz"], GyroLogError)
    return GyroLog(t_s - video_start_s, rate_rad_s, path)
