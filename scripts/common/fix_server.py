"""A simulated receiver on a TCP port of this computer, which can be stopped and started again."""

import contextlib
import socket
import threading
from datetime import UTC, datetime, timedelta

from pynmeagps import GET, NMEAMessage

from vgps.model import FixClass
from vgps.readers.gps_formats.fixes import Fix

_QUALITY = {FixClass.RTK_FIX: 4, FixClass.RTK_FLOAT: 5, FixClass.DGPS: 2, FixClass.SINGLE: 1}


def sentences(fix: Fix, start_utc: datetime, valid: bool = True) -> bytes:
    """Return GGA and ZDA of a fix, or of an epoch without one; ``t_s`` counts from ``start_utc``."""
    utc = start_utc + timedelta(seconds=fix.t_s)
    position = {
        "lat": fix.latitude_deg,
        "NS": "N" if fix.latitude_deg >= 0 else "S",
        "lon": fix.longitude_deg,
        "EW": "E" if fix.longitude_deg >= 0 else "W",
        "quality": _QUALITY[fix.fix_class] if valid else 0,
    }
    height = {
        "numSV": 12,
        "HDOP": 0.8,
        "alt": round(fix.height_m, 4),
        "altUnit": "M",
        "sep": 0.0,
        "sepUnit": "M",
    }
    gga = NMEAMessage("GN", "GGA", GET, hpnmeamode=True, time=utc.time(), **position, **height)
    day = {"day": f"{utc.day:02d}", "month": f"{utc.month:02d}", "year": utc.year}
    zda = NMEAMessage("GN", "ZDA", GET, time=utc.time(), **day, ltzh="00", ltzn="00")
    return bytes(gga.serialize() + zda.serialize())


class FixServer:
    """Sends fixes as NMEA to whoever is connected, as a receiver does; nobody else gets them later."""

    start_utc = datetime(2026, 1, 1, 12, 0, 0, tzinfo=UTC)

    def __init__(self) -> None:
        self._listening: socket.socket | None = None
        self._clients: list[socket.socket] = []
        self.port = 0
        self.start()

    @property
    def connected(self) -> bool:
        """Whether anyone is connected."""
        return bool(self._clients)

    def start(self) -> None:
        """Listen, on the same port each time."""
        self._listening = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listening.getsockname()[1]
        threading.Thread(target=self._accept, args=(self._listening,), daemon=True).start()

    def stop(self) -> None:
        """Close all connections and refuse new ones."""
        if self._listening is not None:
            with contextlib.suppress(OSError):
                self._listening.shutdown(socket.SHUT_RDWR)
            self._listening.close()
        for client in self._clients:
            client.close()
        self._listening, self._clients = None, []

    def send(self, fix: Fix, valid: bool = True) -> None:
        """Send a fix, or an epoch without one."""
        for client in list(self._clients):
            with contextlib.suppress(OSError):
                client.sendall(sentences(fix, self.start_utc, valid))

    def _accept(self, listening: socket.socket) -> None:
        while True:
            try:
                client, _ = listening.accept()
            except OSError:
                return
            self._clients.append(client)
