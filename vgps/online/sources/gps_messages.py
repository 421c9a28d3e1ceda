"""Fixes from a receiver's stream of messages, epoch by epoch, parsed by the readers of logs."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

from pyubx2 import NMEA_PROTOCOL, PARSE_NONE, UBX_PROTOCOL, UBXReader

from vgps.readers.gps_formats.fixes import Clock, Fix, RawLog, has_height
from vgps.readers.gps_formats.nmea import read_nmea
from vgps.readers.gps_formats.ubx import read_ubx

_NAV_TOW_AT = {b"\x07": 6, b"\x14": 10, b"\x04": 6}  # NAV-PVT, HPPOSLLH, DOP: offset of the time of week
_TIMED = {b"GGA": 1, b"GNS": 1, b"GST": 1, b"RMC": 1, b"ZDA": 1, b"GLL": 5}  # the field with the time
_DATED = (b"RMC", b"ZDA")
_COLLECTED = (*_TIMED, b"GSA")
_NO_HEIGHTS_S = 3.0  # without heights, after which fixes are taken that have none: those of RMC or GLL


class ByteStream(Protocol):
    """A stream of bytes whose methods block until data arrive."""

    def read(self, size: int, /) -> bytes:
        """Return ``size`` bytes, fewer at the end."""
        ...

    def readline(self) -> bytes:
        """Return bytes up to the end of a line."""
        ...


def messages(stream: ByteStream) -> Iterator[bytes]:
    """Yield the complete NMEA sentences and UBX messages of a stream; skip everything else."""
    filters = NMEA_PROTOCOL | UBX_PROTOCOL
    reader = UBXReader(stream, protfilter=filters, quitonerror=0, parsing=PARSE_NONE)
    while True:
        try:
            raw, _ = reader.read()
        except (UnicodeDecodeError, IndexError):  # binary data after what looked like a sentence
            continue
        if raw is None:
            return
        yield raw


@dataclass(frozen=True)
class StreamedFix:
    """A fix on the clock of its format."""

    clock: Clock
    fix: Fix


class Epochs:
    """Collector of the messages of one epoch, which a later message or :meth:`flush` ends.

    As in a log, NMEA is used only before the first NAV-PVT, and RMC and GLL only of a receiver that sends no
    fixes with heights. ``line`` of a fix is the number of its message.

    Attributes:
        notes: For the user; whoever reads them clears them.
    """

    def __init__(self) -> None:
        self._epoch: list[bytes] = []
        self._key = b""
        self._date = b""
        self._binary = self._has_heights = self._told = False
        self._since_s = float("inf")
        self._count = 0
        self.notes: list[str] = []

    def add(self, raw: bytes) -> list[StreamedFix]:
        """Add a message, and return the fix of the previous epoch if the message ends it."""
        self._count += 1
        if raw[:2] == b"\xb5\x62":
            return self._add_ubx(raw)
        kind = raw[3:6]
        if self._binary or kind not in _COLLECTED or (self._has_heights and kind == b"GLL"):
            return []
        done = []
        if kind in _TIMED:
            at = _TIMED[kind]
            key = b",".join(raw.split(b",")[at : at + 1])  # nothing in a sentence without fields
            done = self.flush() if key != self._key else []
            self._key = key
        self._epoch.append(raw.strip() + b"\n")
        return done

    def _add_ubx(self, raw: bytes) -> list[StreamedFix]:
        at = _NAV_TOW_AT.get(raw[3:4]) if raw[2:3] == b"\x01" else None
        if at is None or not (self._binary or raw[3:4] == b"\x07"):
            return []
        if not self._binary and raw[3:4] == b"\x07":
            self._binary, self._epoch = True, []
        key = raw[at : at + 4]
        done = self.flush() if key != self._key else []
        self._key = key
        self._epoch.append(raw)
        return done

    def flush(self) -> list[StreamedFix]:
        """End the epoch, and return the fix of its messages, if any."""
        epoch, self._epoch, self._key = self._epoch, [], b""
        if not epoch:
            return []
        found = read_ubx(b"".join(epoch)) if self._binary else self._read_nmea(epoch)
        fixes = found.fixes if self._binary else self._usable(found)
        return [StreamedFix(found.clock, fix._replace(line=self._count)) for fix in fixes]

    def _read_nmea(self, epoch: list[bytes]) -> RawLog:
        dated = [raw for raw in epoch if raw[3:6] in _DATED]
        found = read_nmea(b"".join(epoch)) if dated else self._read_with_date(epoch)
        if dated and found.clock is Clock.UTC:
            self._date = dated[-1]
        elif dated and self._date:
            found = self._read_with_date(epoch)
        return found

    def _read_with_date(self, epoch: list[bytes]) -> RawLog:
        """Read an epoch behind the sentence that had the last date, which may have a place, too."""
        found = read_nmea(b"".join([self._date, *epoch]))
        first_line = 2 if self._date else 1
        return replace(found, fixes=[fix for fix in found.fixes if fix.line >= first_line])

    def _usable(self, found: RawLog) -> list[Fix]:
        """Return the fixes without those that have no heights, unless the receiver has sent no others."""
        usable = []
        for fix in found.fixes:
            self._has_heights |= has_height(fix)
            self._since_s = min(self._since_s, fix.t_s)
            waited = fix.t_s - self._since_s >= _NO_HEIGHTS_S
            if has_height(fix) or (waited and not self._has_heights):
                usable.append(fix)
        if usable and not self._has_heights and not self._told:
            self.notes += [*found.notes, *found.doubts]
            self._told = True
        return usable
