"""Coordinate systems by their EPSG codes, with pyproj; a missing grid is an error and never a zero."""

import warnings
from calendar import isleap
from datetime import UTC, datetime, timedelta

import numpy as np
from pyproj import CRS, Transformer
from pyproj.crs import CompoundCRS, VerticalCRS
from pyproj.exceptions import CRSError
from pyproj.transformer import AreaOfInterest, TransformerGroup

from vgps.crs.geoid import Geoid, egm96, named_geoid
from vgps.crs.system import ELLIPSOIDAL, CoordinateSystem
from vgps.errors import CoordinateSystemError
from vgps.model import FloatArray

WGS84 = "EPSG:4979"
_EGM96_HEIGHT = 5773  # EPSG code of heights above EGM96, whose grid comes with vgps
_AROUND_DEG = 0.01
_BEYOND_DEG = 3.0  # by which data may lie outside a system's area of use
_UNITS = {"metre": "m", "degree": "deg", "foot": "ft", "US survey foot": "us_ft"}
_SHIFTS = ("helmert", "gridshift", "molodensky")  # steps that change the datum
_VAGUE_M = 0.5  # from this accuracy on, how a datum was reached matters to RTK


def decimal_year(instant: datetime) -> float:
    """Return the epoch of an instant as frames have it: 2026.5 is the middle of the year; naive is UTC."""
    utc = instant.astimezone(UTC) if instant.tzinfo else instant.replace(tzinfo=UTC)
    days = 366 if isleap(utc.year) else 365
    return utc.year + (utc - datetime(utc.year, 1, 1, tzinfo=UTC)) / timedelta(days=days)


def coordinate_system(
    place: tuple[float, float],
    crs: str | None = None,
    geoid: str | None = None,
    *,
    source: str | None = None,
    epoch: float = np.inf,
) -> CoordinateSystem:
    """Return a coordinate system for the surroundings of a place.

    Args:
        place: Latitude and longitude [deg] of the data, which select among the conversions that PROJ knows.
        crs: ``EPSG:NNNN``, ``EPSG:NNNN+MMMM`` or another definition that PROJ reads; None for longitude and
            latitude in WGS 84.
        geoid: As for :func:`named_geoid`; what heights are above. It replaces the vertical part of ``crs``.
        source: System of the positions, if not WGS 84: ``EPSG:9989`` for ITRF2020.
        epoch: Decimal year of the positions, where ``source`` moves against ``crs``.

    Raises:
        CoordinateSystemError: There is no such system or geoid, its heights need a grid that is not
            installed, or the place is outside its area.
    """
    model = None if geoid is None else named_geoid(geoid)
    if crs is None and source is None:
        return _plain(model)
    whole, origin = _parsed(crs or WGS84), _parsed(source or WGS84)
    _check_area(whole, crs or WGS84, place)
    horizontal, vertical = _parts(whole)
    if model is None and vertical is not None and vertical.to_epsg() == _EGM96_HEIGHT:
        model = egm96()
    converts_heights = model is None and (vertical is not None or _has_own_heights(horizontal))
    target = whole if converts_heights else horizontal
    transformer, notes = _transformer(origin, target, place, crs or WGS84)
    code = horizontal.to_epsg()
    return CoordinateSystem(
        name=f"{horizontal.name} ({crs or WGS84})",
        height_datum=_height_datum(vertical, horizontal, model, converts_heights),
        axes=_axes(horizontal, vertical if converts_heights else None),
        definition=target if converts_heights else _definition(horizontal, model),
        epsg=code,
        notes=notes,
        transformer=transformer,
        has_heights=converts_heights,
        geoid=model,
        epoch=epoch,
    )


def _plain(model: Geoid | None) -> CoordinateSystem:
    """Return longitude and latitude in WGS 84, and heights above its ellipsoid or above a geoid."""
    return CoordinateSystem(
        name="WGS 84 (EPSG:4979)" if model is None else "WGS 84 (EPSG:4326)",
        height_datum=ELLIPSOIDAL if model is None else _above(model),
        axes=("longitude_deg", "latitude_deg", "height_m"),
        definition=CRS.from_epsg(4979) if model is None else _definition(CRS.from_epsg(4326), model),
        epsg=4326,
        geoid=model,
    )


def _parsed(text: str) -> CRS:
    try:
        return CRS.from_user_input(text)
    except CRSError as error:
        raise CoordinateSystemError(
            f"no coordinate system {text!r}", expected="EPSG:NNNN or EPSG:NNNN+MMMM, such as EPSG:25832+7837"
        ) from error


def _parts(whole: CRS) -> tuple[CRS, CRS | None]:
    """Return the horizontal part, and the vertical part of a compound system."""
    if whole.is_vertical and not whole.is_compound:
        raise CoordinateSystemError(
            f"{whole.name} has heights alone",
            expected="a horizontal part too, such as EPSG:25832+7837",
            remedy="name a compound system, or give the heights' geoid with --geoid",
        )
    if whole.is_compound:
        return whole.sub_crs_list[0], whole.sub_crs_list[1]
    return whole, None


def _has_own_heights(horizontal: CRS) -> bool:
    """Whether a system of three axes defines its heights (or is geocentric)."""
    return len(horizontal.axis_info) == 3


def _check_area(whole: CRS, text: str, place: tuple[float, float]) -> None:
    latitude, longitude = place
    for part in (*whole.sub_crs_list, whole):
        area = part.area_of_use
        if area is None:
            continue
        width = (area.east - area.west) % 360.0 or 360.0  # an area may cross 180 degrees
        inside_east = (longitude - area.west + _BEYOND_DEG) % 360.0 <= width + 2.0 * _BEYOND_DEG
        if not (inside_east and area.south - _BEYOND_DEG <= latitude <= area.north + _BEYOND_DEG):
            raise CoordinateSystemError(
                f"{text} ({part.name}) is for {area.west:g}° to {area.east:g}° east, {area.south:g}° to "
                f"{area.north:g}° north; the run lies at {latitude:.4f}°, {longitude:.4f}°",
                remedy="name the system of that place",
            )


def _transformer(
    origin: CRS, target: CRS, place: tuple[float, float], text: str
) -> tuple[Transformer, tuple[str, ...]]:
    """Return the best conversion around a place that is installed, and notes on it."""
    latitude, longitude = place
    around = AreaOfInterest(
        longitude - _AROUND_DEG, latitude - _AROUND_DEG, longitude + _AROUND_DEG, latitude + _AROUND_DEG
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that the best is not available: checked below
        group = TransformerGroup(
            origin, target, always_xy=True, area_of_interest=around, allow_ballpark=False
        )
    missing = sorted({g.short_name for o in group.unavailable_operations for g in o.grids if not g.available})
    if not group.transformers:
        raise CoordinateSystemError(
            f"{text} needs the grid {missing[0]}, which is not installed"
            if missing
            else f"PROJ has no conversion from {origin.name} to {text}",
            remedy="put it into PROJ's data folder (cdn.proj.org, or projsync --file), or give the geoid of "
            "the heights with --geoid FILE"
            if missing
            else "name another system, or another --gps-crs",
        )
    best = group.transformers[0]
    notes = []
    if not group.best_available and missing:
        notes.append(f"the conversion to {target.name} is less accurate without the grid {missing[0]}")
    if best.accuracy >= _VAGUE_M and not any(step in best.definition for step in _SHIFTS):
        notes.append(_taken_as_one(origin, target, best.accuracy))
    elif best.accuracy >= _VAGUE_M:
        notes.append(f"the conversion to {target.name} is accurate to {best.accuracy:g} m, says EPSG")
    return best, tuple(notes)


def _taken_as_one(origin: CRS, target: CRS, accuracy_m: float) -> str:
    """Return the note on two datums between which PROJ applies no shift."""
    if origin != _parsed(WGS84):
        return (
            f"{origin.name} and the datum of {target.name} are taken as one: PROJ has no shift between them, "
            f"and says that they agree to {accuracy_m:g} m"
        )
    return (
        f"positions are taken to be in the datum of {target.name}, which differs from {origin.name} by "
        f"up to {accuracy_m:g} m: true of fixes corrected in that datum, as by national RTK services; "
        "name any other frame of the fixes with --gps-crs, as EPSG:9989 for ITRF2020"
    )


def _height_datum(vertical: CRS | None, horizontal: CRS, model: Geoid | None, converts: bool) -> str:
    if model is not None:
        return _above(model)
    if vertical is not None:
        return str(vertical.name)
    if converts and not horizontal.is_geocentric:
        return f"height above the ellipsoid of {horizontal.name}"
    return "geocentric, without heights" if converts else ELLIPSOIDAL


def _definition(horizontal: CRS, model: Geoid | None) -> CRS:
    """Return a horizontal system with heights above its ellipsoid or above a geoid."""
    if model is None:
        return horizontal.to_3d()
    if model is egm96():
        vertical = CRS.from_epsg(_EGM96_HEIGHT)
    else:
        datum = {"type": "VerticalReferenceFrame", "name": model.name}
        vertical = VerticalCRS(name=_above(model), datum=datum)
    return CompoundCRS(f"{horizontal.name} + {vertical.name}", [horizontal, vertical])


def _above(model: Geoid) -> str:
    return f"height above {model.name}" if "geoid" in model.name else f"height above the geoid {model.name}"


def _axes(horizontal: CRS, vertical: CRS | None) -> tuple[str, str, str]:
    units = [_UNITS.get(axis.unit_name, axis.unit_name.replace(" ", "_")) for axis in horizontal.axis_info]
    height = vertical.axis_info[0].unit_name if vertical is not None else "metre"
    up = f"height_{_UNITS.get(height, height.replace(' ', '_'))}"
    if horizontal.is_geocentric:
        return "x_m", "y_m", "z_m"
    if horizontal.is_geographic:
        return "longitude_deg", "latitude_deg", up
    return f"easting_{units[0]}", f"northing_{units[0]}", up


def place_in(crs: str, coordinates: FloatArray) -> tuple[float, float]:
    """Return latitude and longitude [deg], roughly, of coordinates (2,) or (3,) in a system.

    Raises:
        CoordinateSystemError: There is no such system, or the coordinates are not in it.
    """
    horizontal, _ = _parts(_parsed(crs))
    transformer = Transformer.from_crs(horizontal, _parsed("EPSG:4326"), always_xy=True)
    longitude, latitude = transformer.transform(*coordinates[: len(horizontal.axis_info)].tolist())[:2]
    if not (np.isfinite(latitude) and np.isfinite(longitude)):
        raise CoordinateSystemError(
            f"{', '.join(f'{value:g}' for value in coordinates)} are no coordinates in {crs}",
            expected="easting or longitude first",
        )
    return float(latitude), float(longitude)
