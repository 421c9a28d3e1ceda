"""A receiver on a serial port, a network port or standard input, read in a thread of its own."""

import contextlib
import os
import queue
import socket
import stat
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import urlsplit

import serial

from vgps.errors import GpsLogError
from vgps.online.sources.gps_messages import ByteStream, Epochs, StreamedFix, messages

_QUIET_S = 0.05  # silence that ends an epoch
_SILENCE_S = 10.0  # silence after which the source is reopened
_RETRY_S = (0.2, 5.0)  # first and longest pause between two attempts
_GPSD_PORT = 2947  # as assigned by IANA
_BAUD = 115200  # unless the address names another
_FORMS = (
    "a serial port (/dev/ttyACM0 or /dev/ttyUSB0@38400), tcp://HOST:PORT, gpsd://HOST or - (standard input)"
)


@dataclass(frozen=True)
class ReceivedFix:
    """A fix, and the arrival of its last message by this computer's clock, unix seconds."""

    streamed: StreamedFix
    unix_s: float


class GpsSource:
    """A live source of fixes; a connection that drops or falls silent is reopened until the source is closed.

    Args:
        address: A serial port with or without ``@BAUD``, ``tcp://HOST:PORT``, ``gpsd://HOST[:PORT]`` or
            ``-`` for standard input.

    Raises:
        GpsLogError: The source cannot be opened.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self._messages: queue.Queue[tuple[bytes, float]] = queue.Queue()
        self._notes: queue.Queue[str] = queue.Queue()
        self._epochs, self._last_s = Epochs(), 0.0
        self._closed = threading.Event()
        try:
            self._open, self._again = _opener(address)
            self._stream: Any = self._open()
        except (
            OSError,
            ValueError,
            OverflowError,
            serial.SerialException,
        ) as error:  # a port of no number too
            reason = getattr(error, "strerror", None) or error
            raise GpsLogError(f"cannot be opened ({reason})", file=address, expected=_FORMS) from error
        threading.Thread(target=self._work, name="gps", daemon=True).start()

    def poll(self) -> tuple[list[ReceivedFix], list[str]]:
        """Return the fixes received since the last call, and notes on the connection."""
        found: list[ReceivedFix] = []
        while True:
            try:
                raw, unix_s = self._messages.get_nowait()
            except queue.Empty:
                break
            found += [ReceivedFix(fix, self._last_s) for fix in self._epochs.add(raw)]
            self._last_s = unix_s
        if time.time() - self._last_s > _QUIET_S:
            found += [ReceivedFix(fix, self._last_s) for fix in self._epochs.flush()]
        notes, self._epochs.notes = self._epochs.notes, []
        with contextlib.suppress(queue.Empty):
            while True:
                notes.append(self._notes.get_nowait())
        return found, notes

    def close(self) -> None:
        """Stop reading; the thread closes the stream, since closing a silent one would block."""
        self._closed.set()

    def _work(self) -> None:
        try:
            self._read_until_closed()
        finally:
            with contextlib.suppress(OSError, serial.SerialException):
                self._stream.close()

    def _read_until_closed(self) -> None:
        wait_s, dropped = _RETRY_S[0], False
        while not self._closed.is_set():
            begun_s = time.monotonic()
            with contextlib.suppress(OSError, serial.SerialException, TypeError, ValueError):
                for raw in messages(self._stream):
                    if dropped:
                        self._notes.put(f"{self.address}: connected again")
                    dropped = False
                    self._messages.put((raw, time.time()))
                    if self._closed.is_set():
                        return
            if self._closed.is_set():
                return
            if not self._again:
                self._notes.put(f"{self.address}: the stream of fixes ended")
                return
            if not dropped:
                self._notes.put(f"{self.address}: the connection dropped; reconnecting")
            # back off from a server that hangs up at once
            lasted = time.monotonic() - begun_s > _RETRY_S[1]
            wait_s, dropped = self._reconnected(_RETRY_S[0] if lasted else wait_s), True

    def _reconnected(self, wait_s: float) -> float:
        """Reconnect, and return the pause before the next attempt should this connection fail at once."""
        with contextlib.suppress(OSError, serial.SerialException):
            self._stream.close()
        while not self._closed.wait(wait_s):
            wait_s = min(2.0 * wait_s, _RETRY_S[1])
            with contextlib.suppress(OSError, serial.SerialException):
                self._stream = self._open()
                return wait_s
        return wait_s


def _opener(address: str) -> tuple[Callable[[], ByteStream], bool]:
    """Return a function that opens the source, and whether it may be reopened.

    Raises:
        GpsLogError: The address has no known form.
    """
    if address == "-":
        # not sys.stdin's buffer, which a waiting thread would keep locked when Python exits
        return lambda: os.fdopen(sys.stdin.fileno(), "rb", closefd=False), False
    parts = urlsplit(address)
    if parts.scheme in {"tcp", "gpsd"} and parts.hostname:
        host, watch = parts.hostname, parts.scheme == "gpsd"
        port = parts.port or (_GPSD_PORT if watch else 0)
        if port:
            return lambda: _connected(host, port, watch), True
    device, _, baud = address.partition("@")
    if baud and not baud.isdigit():
        raise GpsLogError(f"baud rate {baud!r}", file=address, expected=_FORMS)
    path = Path(device)
    if path.is_file() or (path.exists() and stat.S_ISFIFO(path.stat().st_mode)):
        return lambda: path.open("rb"), False
    if path.exists() or device.upper().startswith("COM"):
        rate = int(baud or _BAUD)
        return lambda: serial.Serial(device, rate, timeout=_SILENCE_S), True
    raise GpsLogError("no such GPS source", file=address, expected=_FORMS)


def _connected(host: str, port: int, watch: bool) -> BinaryIO:
    connection = socket.create_connection((host, port), timeout=_SILENCE_S)
    if watch:  # ask gpsd for the receiver's NMEA, or its translation of other protocols
        connection.sendall(b'?WATCH={"enable":true,"nmea":true}\n')
    stream = connection.makefile("rb")
    connection.close()  # the stream keeps it open
    return stream
