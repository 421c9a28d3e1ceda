"""What do users' programs do to the fixes of a receiver before vgps reads them?

The log of a recording with truth is written with few digits, with time stamps that are off by turns, and with
positions interpolated for ten times a second; and RTK-fixes are made at 50 a second, right to a centimetre,
and at 10 with noise that no receiver has, as of an antenna that sways beside the camera. Errors are those of
all poses, unaligned, offline and live as they came.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.interpolate import CubicSpline

import vgps
from scripts.common.both_ways import Case, print_both_ways
from vgps.geodesy import to_geodetic
from vgps.model import FixClass, FloatArray, GpsLog, Recording

_HEADER = "t_s,latitude_deg,longitude_deg,height_m,fix_class"
_LASTS_S = 2.0  # errors of a centimetre


def changed(log: GpsLog, rng: np.random.Generator) -> Iterator[tuple[str, GpsLog]]:
    """Yield the changes of a log with their names."""
    yield "as it is", log
    for decimals in (5, 6):
        yield f"{decimals} decimals of degrees", rounded(log, decimals)
    yield "4 decimals of minutes", rounded(log, 4, per_degree=60)
    for off_s in (0.02, 0.05, 0.1):
        late_s = rng.uniform(-off_s, off_s, len(log))
        yield f"stamps up to {off_s:g} s off", replace(log, t_s=log.t_s + late_s)
    yield "interpolated ten times a second", interpolated(log, 0.1)


def rounded(log: GpsLog, decimals: int, per_degree: int = 1) -> GpsLog:
    """Return a log with so many decimals of degrees, or of parts of them, and one of heights."""
    return replace(
        log,
        latitude_deg=np.round(per_degree * log.latitude_deg, decimals) / per_degree,
        longitude_deg=np.round(per_degree * log.longitude_deg, decimals) / per_degree,
        height_m=np.round(log.height_m, 1),
    )


def interpolated(log: GpsLog, interval_s: float) -> GpsLog:
    """Return a log with fixes on the lines between those of another."""
    t_s = np.arange(log.t_s[0], log.t_s[-1], interval_s)
    before = np.searchsorted(log.t_s, t_s, side="right") - 1
    names = "latitude_deg", "longitude_deg", "height_m"
    places = {name: np.interp(t_s, log.t_s, getattr(log, name)) for name in names}
    return replace(log.rows(before), t_s=t_s, **places)


def made(recording: Recording, true: FloatArray, rate_hz: float, noise_m: float, seed: int = 0) -> GpsLog:
    """Return RTK-fixes that err by a centimetre for seconds, and by noise, at a rate.

    Args:
        recording: With an origin of the world.
        true: (F, 4, 4) poses of its camera.
        rate_hz, noise_m: Fixes a second, and noise on each axis.
        seed: Of the errors.
    """
    frame_s, rng = recording.video.times_s, np.random.default_rng(seed)
    assert recording.gps is not None and recording.rig.world_origin is not None
    t_s = np.arange(frame_s[0], frame_s[-1], 1.0 / rate_hz)
    keeps = float(np.exp(-1.0 / rate_hz / _LASTS_S))
    lasting = 0.01 * rng.normal(size=(len(t_s), 3))
    for k in range(1, len(t_s)):
        lasting[k] = keeps * lasting[k - 1] + np.sqrt(1.0 - keeps**2) * lasting[k]
    antenna = true[:, :3, :3] @ recording.rig.camera_p_antenna + true[:, :3, 3]
    place = CubicSpline(frame_s, antenna)(t_s) + lasting + noise_m * rng.normal(size=(len(t_s), 3))
    latitude, longitude, height = to_geodetic(recording.rig.world_origin, place).T
    log = recording.gps.rows(np.zeros(len(t_s), dtype=np.int64))
    places = {"latitude_deg": latitude, "longitude_deg": longitude, "height_m": height}
    return replace(log, t_s=t_s, fix_class=(FixClass.RTK_FIX,) * len(t_s), **places)


def write_csv(log: GpsLog, path: Path) -> None:
    """Write a log as a program would."""
    columns = log.t_s, log.latitude_deg, log.longitude_deg, log.height_m, log.fix_class
    rows = [
        f"{t_s:.6f},{latitude:.10f},{longitude:.10f},{height:.4f},{kind}"
        for t_s, latitude, longitude, height, kind in zip(*columns, strict=True)
    ]
    path.write_text("\n".join([_HEADER, *rows, ""]), encoding="utf-8")


def cases(recording: Recording, true: FloatArray) -> Iterator[Case]:
    """Yield a recording with each change of its log; true poses are (F, 4, 4)."""
    assert recording.gps is not None
    logs = dict(changed(recording.gps, np.random.default_rng(0)))
    logs["made at 50 a second"] = made(recording, true, 50.0, 0.0)
    logs["made at 10 a second, noise of 0.05 m"] = made(recording, true, 10.0, 0.05)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "gps.csv"
        for name, log in logs.items():
            write_csv(log, path)
            yield Case(name, vgps.open_recording(recording.path, gps=path), np.arange(len(true)), true)


def main() -> None:
    """Print a markdown table, two rows per recording, change and seed."""
    print_both_ways("experiments.changed_logs", __doc__, "log", "gps_fix.nmea", cases)


if __name__ == "__main__":
    main()
