"""Receivers and cameras for tests: bytes and pictures over real sockets and terminals."""

import contextlib
import os
import pty
import socket
import threading
import time
import tty
from fractions import Fraction
from pathlib import Path

import av
import numpy as np


def epochs_of(log: bytes) -> list[bytes]:
    """An NMEA log cut before every GGA."""
    parts = log.split(b"$GNGGA" if b"$GNGGA" in log else b"$GPGGA")
    head = b"$GNGGA" if b"$GNGGA" in log else b"$GPGGA"
    return [head + part for part in parts[1:]]


class TcpServer:
    """Serves one client after the other; each gets what ``serve(connection)`` sends, then is cut off."""

    def __init__(self, serve):
        self._socket = socket.create_server(("127.0.0.1", 0))
        self._serve = serve
        self.clients = 0
        self.port = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def _work(self):
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            self.clients += 1
            with contextlib.suppress(OSError), connection:
                self._serve(connection)

    def close(self):
        self._socket.close()


class Terminal:
    """A pseudo-terminal: ``path`` is what a serial port looks like."""

    def __init__(self):
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        self.path, self._slave = os.ttyname(slave), slave

    def send(self, data: bytes):
        os.write(self.master, data)

    def close(self):
        os.close(self._slave)
        os.close(self.master)


def mpeg_ts(video: Path, out: Path, frames: int = 10**9) -> Path:
    """The video's first frames as a transport stream that can be cut anywhere."""
    with av.open(str(video)) as source, av.open(str(out), "w", format="mpegts") as sink:
        stream = source.streams.video[0]
        target = sink.add_stream("libx264", rate=15, options={"tune": "zerolatency", "preset": "ultrafast"})
        target.width, target.height, target.pix_fmt = stream.width, stream.height, "yuv420p"
        target.bit_rate = 4_000_000
        target.gop_size = 1
        for count, frame in enumerate(source.decode(video=0)):
            if count == frames:
                break
            frame.pts, frame.time_base = count, Fraction(1, 15)
            sink.mux(target.encode(frame))
        sink.mux(target.encode(None))
    return out


def paced(data: bytes, seconds: float, parts: int):
    """A ``serve`` that sends the data evenly over some seconds."""

    def serve(connection):
        size = int(np.ceil(len(data) / parts))
        for k in range(parts):
            connection.sendall(data[k * size : (k + 1) * size])
            time.sleep(seconds / parts)

    return serve


def until(condition, seconds: float = 20.0):
    """Wait for something to become true, and give it."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.02)
    raise AssertionError("nothing came")
