"""What a surveyor states about a run: its datum, epoch, coordinates, and the settings that were changed."""

from collections.abc import Iterator, Mapping
from datetime import UTC
from typing import Any

import numpy as np

from vgps.config import Config
from vgps.crs import CoordinateSystem, decimal_year, egm96
from vgps.geodesy import to_geodetic
from vgps.model import FloatArray, IntArray
from vgps.solution import Solution


def datum_facts(solution: Solution, system: CoordinateSystem | None) -> list[tuple[str, str]]:
    """Return names and values of what coordinates, heights and times refer to.

    Args:
        solution: The run.
        system: What the report states coordinates in; None if the run is not georeferenced.
    """
    facts = []
    origin = solution.world_origin
    if system is not None and origin is not None:
        undulation = float(egm96().height_m(*origin[:2]))
        facts += [
            ("coordinate system", system.name),
            ("heights", system.height_datum),
            (
                "frame of the fixes",
                "WGS 84 as the receiver or its corrections realise it: ITRF for satellite corrections and "
                "PPP, the national frame for a reference network",
            ),
            ("axes of the path", "east, north, up at the origin; metres"),
            ("origin", _coordinates_text(system, np.array(origin))),
            ("first camera", _at_frame(solution, system, 0)),
            ("last camera", _at_frame(solution, system, -1)),
            ("EGM96 at the origin", f"{undulation:.2f} m above the ellipsoid"),
        ]
    return facts + _epoch(solution)


def _epoch(solution: Solution) -> list[tuple[str, str]]:
    start = solution.video_start_utc
    if start is None:
        return [("epoch", "unknown: the recording does not say when it began")]
    utc = start.astimezone(UTC)
    epoch = f"{utc:%Y-%m-%d %H:%M:%S} UTC, {decimal_year(utc):.3f}"
    return [("epoch", epoch), ("times", "seconds from the first frame")]


def _at_frame(solution: Solution, system: CoordinateSystem, frame: int) -> str:
    assert solution.world_origin is not None
    position = to_geodetic(solution.world_origin, solution.world_T_camera[frame, :3, 3])
    return _coordinates_text(system, position)


def _coordinates_text(system: CoordinateSystem, geodetic: FloatArray) -> str:
    """Return coordinates in a system, with their names and units, of latitude, longitude and height (3,)."""
    digits = (9, 9, 3) if system.is_geographic else (3, 3, 3)
    axes = [name.split("_", 1) for name in system.axes]
    values = system.from_geodetic(geodetic)[0].tolist()
    return ", ".join(
        f"{axis} {value:.{digit}f} {unit.replace('deg', '°')}"
        for (axis, unit), value, digit in zip(axes, values, digits, strict=True)
    )


def class_spells(solution: Solution) -> list[tuple[str, float, float, int]]:
    """Return class, begin and end [s], and number of fixes of each spell of fixes of one class, in order."""
    if solution.judged_fixes is None:
        return []
    log, _ = solution.judged_fixes
    classes, times = np.array(log.fix_class, dtype=str), solution.fix_times_s
    starts: IntArray = np.flatnonzero(np.concatenate([[True], classes[1:] != classes[:-1]]))
    ends = np.append(starts[1:], len(classes))
    return [
        (str(classes[a]), float(times[a]), float(times[b - 1]), int(b - a))
        for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
    ]


def changed_settings(config: Mapping[str, Any]) -> list[tuple[str, Any, Any]]:
    """Return name, value and default of every setting of a resolved configuration that differs from it."""
    return list(_differences(dict(config), Config().model_dump(mode="json"), ""))


def _differences(found: Any, default: Any, place: str) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(found, Mapping) and isinstance(default, Mapping):
        for key in found:
            name = f"{place}.{key}" if place else str(key)
            yield from _differences(found[key], default.get(key), name)
    elif found != default and not (isinstance(found, list | tuple) and list(found) == list(default or [])):
        yield place, found, default
