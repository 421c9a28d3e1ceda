"""Septentrio's binary SBF, with pysbf2 (the extra ``logs``): PVTGeodetic, refined by PosCovGeodetic."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vgps.model import FixClass
from vgps.readers.extras import optional_module
from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, Triple, axis_sigmas, skipped, uncertainty
from vgps.readers.gps_formats.leap_seconds import utc_of_week

_PVT, _COVARIANCE = 4007, 5906
_ID = 0x1FFF  # the other bits of the field are the revision
_BLOCK = re.compile(rb"\$@..(..)(..)", re.DOTALL)
_UNKNOWN, _UNKNOWN_U16 = -1e10, 65535  # floats below this are "do not use"
_CLASSES = {
    1: FixClass.SINGLE,
    2: FixClass.DGPS,
    3: FixClass.UNKNOWN,  # a position given to the receiver
    4: FixClass.RTK_FIX,
    5: FixClass.RTK_FLOAT,
    6: FixClass.SBAS,
    7: FixClass.RTK_FIX,
    8: FixClass.RTK_FLOAT,
    10: FixClass.PPP,
}
_OF_THE_BASE = 19  # datum: that of the reference stations


def looks_like_sbf(data: bytes) -> bool:
    """Whether there is a PVTGeodetic block among the first megabyte."""
    return any(block == _PVT for block, _, _ in _blocks(data[: 1 << 20]))


def read_sbf(data: bytes, path: Path) -> RawLog:
    """Read the positions onto UTC; heights are ellipsoidal. Damaged blocks are skipped and counted.

    Raises:
        GpsLogError: pysbf2 is not installed.
    """
    parse = optional_module("pysbf2", "logs", path).SBFReader.parse
    positions, variances, damaged = list[Any](), dict[int, Any](), 0
    for block, start, end in _blocks(data):
        try:
            message = parse(data[start:end])
        except Exception:  # pysbf2 raises whatever damaged bytes lead to
            damaged += 1
            continue
        if block == _PVT:
            positions.append(message)
        else:
            variances[message.TOW] = message
    good = [(row, one) for row, one in enumerate(positions, 1) if one.Error == 0 and one.Type in _CLASSES]
    fixes = [_fix(one, variances.get(one.TOW), row) for row, one in good]
    notes = [
        *skipped(damaged, "damaged block"),
        *skipped(len(positions) - len(fixes), "epoch", "without a fix"),
    ]
    if any(one.Datum == _OF_THE_BASE for _, one in good):
        notes.append("positions are in the datum of the reference stations, says the receiver")
    return RawLog(Clock.UTC, fixes, notes)


def _blocks(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield id, start and end of the blocks of interest."""
    for match in _BLOCK.finditer(data):
        block = int.from_bytes(match[1], "little") & _ID
        length = int.from_bytes(match[2], "little")
        if block in {_PVT, _COVARIANCE} and match.start() + length <= len(data):
            yield block, match.start(), match.start() + length


def _fix(message: Any, covariance: Any | None, row: int) -> Fix:
    place = [message.Latitude, message.Longitude, message.Height]
    latitude, longitude, height = (value if value > _UNKNOWN else np.nan for value in place)
    sigma, correlation = _uncertainty(message, covariance)
    return Fix(
        utc_of_week(message.WNc, message.TOW * 1e-3),
        float(np.degrees(latitude)),
        float(np.degrees(longitude)),
        float(height),
        _CLASSES[message.Type],
        row,
        sigma,
        satellites=float(message.NrSV),
        correction_age_s=np.nan if message.MeanCorrAge >= _UNKNOWN_U16 / 100 else float(message.MeanCorrAge),
        correlation=correlation,
    )


def _uncertainty(message: Any, covariance: Any | None) -> tuple[Triple, Triple]:
    """Return sigmas and correlations of the covariance, else of the accuracies, which are two sigmas."""
    if covariance is not None:
        ee, nn, uu = covariance.Cov_lonlon, covariance.Cov_latlat, covariance.Cov_hgthgt
        en, eu, nu = covariance.Cov_latlon, covariance.Cov_lonhgt, covariance.Cov_lathgt
        return uncertainty(np.array([[ee, en, eu], [en, nn, nu], [eu, nu, uu]]))
    stated = message.HAccuracy, message.VAccuracy  # two sigmas
    known = (m / 2.0 if m < _UNKNOWN_U16 / 100 else np.nan for m in stated)
    return axis_sigmas(*known), (0.0, 0.0, 0.0)
