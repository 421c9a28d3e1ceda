"""``imu.csv``: angular rates and specific force in the IMU's own axes, and what is wrong with a log."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vgps.errors import ImuLogError
from vgps.model import BoolArray, FloatArray, GyroLog, ImuLog, Rig
from vgps.readers.gps_formats.fixes import counted, skipped
from vgps.readers.table import read_samples

GAP_INTERVALS = 5.0  # sample intervals; a longer time without samples is a gap
_RATES_HZ = (50.0, 1000.0)
_RESTING_M_S2 = (8.0, 12.0)  # median size of the specific force of whatever moves about on the earth
_RESTING_G = (0.8, 1.2)
_MAX_RATE_RAD_S = 40.0  # 2300 deg/s, beyond the range of any sensor in a camera
_LEAST_INTERVAL_S, _MOST_INTERVAL_S = 5e-4, 0.5  # of a log whose times are in seconds
_LEAST_SHARE = 0.95  # of a video, below which it is worth a note what an IMU covers
_CLIPPED_SAMPLES = 5  # in a row at one extreme value: noise alone does not repeat it


def read_imu(path: str | Path, *, video_start_s: float = 0.0) -> ImuLog:
    """Read columns ``t_s, wx_rad_s, wy_rad_s, wz_rad_s, ax_m_s2, ay_m_s2, az_m_s2``.

    Args:
        path: The file.
        video_start_s: The first frame's time on the file's clock; subtracted.

    Returns:
        Samples in strict order of time, without those that are not finite or have the time of another.

    Raises:
        ImuLogError: The file is missing or empty, a column is missing, a cell is not a number, there are
            fewer than two samples, or the numbers are of another unit or order.
    """
    path = Path(path)
    names = [*(f"w{axis}_rad_s" for axis in "xyz"), *(f"a{axis}_m_s2" for axis in "xyz")]
    t_s, values, left_out = read_samples(path, names, ImuLogError)
    notes = skipped(left_out, "sample", "of the IMU")
    return checked_imu(t_s - video_start_s, values[:, :3], values[:, 3:], path, (*notes,))


def find_imu(folder: Path, name: str | None = None) -> Path:
    """Return the IMU's log: a path, or a name inside a recording's folder, by default ``imu.csv``.

    Raises:
        ImuLogError: There is none.
    """
    for file in (folder / (name or "imu.csv"), Path(name or "imu.csv")):
        if file.is_file():
            return file
    raise ImuLogError("no such file", file=folder / (name or "imu.csv"), remedy="name the log with --imu")


def checked_imu(
    t_s: FloatArray, rate_rad_s: FloatArray, force_m_s2: FloatArray, source: Path, notes: tuple[str, ...] = ()
) -> ImuLog:
    """Return a log whose units are plausible, with notes on its rate, its gaps and its saturation.

    Args:
        t_s: (N,) strictly ascending.
        rate_rad_s, force_m_s2: (N, 3) in the sensor's axes.
        source: The file, for messages.
        notes: Notes so far.

    Raises:
        ImuLogError: The numbers are of another unit or order.
    """
    _check_times(t_s, source)
    _check_units(rate_rad_s, force_m_s2, source)
    saturated = _clipped(rate_rad_s) | _clipped(force_m_s2)
    notes = (*notes, *_notes(t_s, saturated, source))
    return ImuLog(
        t_s=t_s, rate_rad_s=rate_rad_s, force_m_s2=force_m_s2, saturated=saturated, source=source, notes=notes
    )


def on_video_clock(log: ImuLog, rig: Rig) -> ImuLog:
    """Return a log with the time offset of the rig removed."""
    return replace(log, t_s=log.t_s + rig.imu_time_offset_s)


def during_video(log: ImuLog, times_s: FloatArray, rig: Rig) -> tuple[ImuLog | None, tuple[str, ...]]:
    """Return a log, None if it has no samples during the video, and its notes with what it covers.

    Args:
        log: On the video's clock.
        times_s: (F,) frame times.
        rig: Its ``video_start_s`` gives the log's own times.
    """
    begin_s, end_s = float(times_s[0]), float(times_s[-1])
    first_s, last_s = max(float(log.t_s[0]), begin_s), min(float(log.t_s[-1]), end_s)
    if last_s <= first_s:
        own_s = log.t_s[[0, -1]] - rig.imu_time_offset_s + rig.video_start_s
        video_s = rig.video_start_s + begin_s, rig.video_start_s + end_s
        return None, (
            f"{log.source.name} is left out: it runs from {own_s[0]:.3f} s to {own_s[1]:.3f} s, the video "
            f"from {video_s[0]:.3f} s to {video_s[1]:.3f} s; video_start_s in rig.yaml is the time of the "
            f"first frame on the clock of {log.source.name}",
        )
    if last_s - first_s < _LEAST_SHARE * (end_s - begin_s):
        covered = f"{log.source.name} covers the video from {first_s:.2f} s to {last_s:.2f} s only"
        return log, (*log.notes, f"{covered}, of {end_s:.2f} s")
    return log, log.notes


def gyro_of(log: ImuLog, rig: Rig) -> GyroLog:
    """Return the angular rates of an IMU, for what needs a gyro only."""
    bias = np.zeros(3) if rig.imu is None else rig.imu.gyro_bias_rad_s
    return GyroLog(log.t_s, log.rate_rad_s - bias, log.source)


@dataclass(frozen=True)
class _Size:
    """Median and largest size of the vectors of a sensor."""

    median: float
    largest: float

    @classmethod
    def of(cls, vectors: FloatArray) -> "_Size":
        size = np.linalg.norm(vectors, axis=1)
        return cls(float(np.median(size)), float(size.max()))


def _check_units(rate_rad_s: FloatArray, force_m_s2: FloatArray, source: Path) -> None:
    rate, force = _Size.of(rate_rad_s), _Size.of(force_m_s2)
    if _within(rate.median, _RESTING_M_S2) and not _within(force.median, _RESTING_M_S2):
        raise ImuLogError(
            f"the rates have the median size {rate.median:.3g}, which is gravity's",
            file=source,
            expected="rates in wx, wy, wz and specific force in ax, ay, az",
            remedy="swap the columns",
        )
    if not _within(force.median, _RESTING_M_S2):
        in_g = _within(force.median, _RESTING_G)
        raise ImuLogError(
            f"the specific force has the median size {force.median:.3g}",
            file=source,
            expected="about 9.8 m/s^2 (gravity included)",
            remedy="multiply by 9.80665: the unit is g"
            if in_g
            else "give the accelerometer's own output, in m/s^2 and with gravity",
        )
    if rate.largest > _MAX_RATE_RAD_S:
        raise ImuLogError(
            f"rates of up to {rate.largest:.3g} rad/s",
            file=source,
            expected=f"at most {_MAX_RATE_RAD_S:g} rad/s",
            remedy="multiply by pi / 180 if the unit is deg/s",
        )


def _check_times(t_s: FloatArray, source: Path) -> None:
    interval_s = float(np.median(np.diff(t_s)))
    if interval_s > _MOST_INTERVAL_S:
        units = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
        likely = [name for per_s, name in units.items() if interval_s / per_s > _LEAST_INTERVAL_S]
        raise ImuLogError(
            f"a sample every {interval_s:.3g} s by t_s",
            file=source,
            expected="t_s in seconds, 50 to 1000 samples a second",
            remedy=f"its unit seems to be {likely[-1]}" if likely else None,
        )


def _within(value: float, limits: tuple[float, float]) -> bool:
    return limits[0] < value < limits[1]


def _clipped(vectors: FloatArray) -> BoolArray:
    """Return (N,) samples in runs at the largest or the smallest value of an axis."""
    clipped = np.zeros(len(vectors), dtype=bool)
    for axis in vectors.T:
        for extreme in (axis.max(), axis.min()):
            runs = np.flatnonzero(np.diff(np.r_[False, axis == extreme, False]))
            for begin, end in runs.reshape(-1, 2).tolist():
                if end - begin >= _CLIPPED_SAMPLES and axis.max() > axis.min():
                    clipped[begin:end] = True
    return clipped


def _notes(t_s: FloatArray, saturated: BoolArray, source: Path) -> list[str]:
    steps = np.diff(t_s)
    interval_s = float(np.median(steps))
    notes = []
    if not _RATES_HZ[0] <= 1.0 / interval_s <= _RATES_HZ[1]:
        low, high = _RATES_HZ
        notes.append(
            f"{source.name} has {1.0 / interval_s:.0f} samples a second: {low:g} to {high:g} are usual"
        )
    gaps = np.flatnonzero(steps > GAP_INTERVALS * interval_s)
    if len(gaps):
        longest = int(gaps[np.argmax(steps[gaps])])
        notes.append(
            f"{source.name} has {counted(len(gaps), 'gap')}, the longest {steps[longest]:.2f} s after "
            f"{t_s[longest]:.2f} s: the video bridges them"
        )
    if saturated.any():
        first = float(t_s[int(np.argmax(saturated))])
        notes.append(
            f"{source.name} is saturated in {counted(int(saturated.sum()), 'sample')}, first at "
            f"{first:.2f} s: they are not used"
        )
    return notes
