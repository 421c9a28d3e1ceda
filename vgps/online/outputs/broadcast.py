"""Servers that send the same to all who are connected, and serial ports, each in a thread of its own.

A client that reads too slowly is cut off, and a serial port that is too slow loses what it has no time for:
poses never wait.
"""

import asyncio
import contextlib
import queue
import threading
from typing import Any, Protocol
from urllib.parse import urlsplit

import serial

from vgps.errors import OutputError

_MOST_WAITING = 1 << 18  # bytes for one client
_MOST_QUEUED = 64  # messages for a serial port
_BAUD = 115200  # unless the address names another
_MOMENT_S, _STOP_S = 0.5, 2.0


class Channel(Protocol):
    """Something that bytes are sent to."""

    def send(self, data: bytes) -> None:
        """Send, at once or not at all."""

    def close(self) -> None:
        """Stop sending."""


class Broadcast:
    """A server on a network port of this computer.

    Args:
        address: ``SCHEME://HOST:PORT``; port 0 lets the system choose one.

    Attributes:
        port: The port.

    Raises:
        OutputError: The address has no such form, or cannot be listened on.
    """

    def __init__(self, address: str) -> None:
        host, port = _host_and_port(address)
        self._clients: set[Any] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="broadcast", daemon=True)
        self._thread.start()
        try:
            self._server = asyncio.run_coroutine_threadsafe(self._listen(host, port), self._loop).result()
        except OSError as error:
            self._stop()
            raise OutputError(
                f"cannot be listened on ({error.strerror or error})",
                file=address,
                remedy="name a free port of this computer",
            ) from error
        self.port = int(self._server.sockets[0].getsockname()[1])

    def send(self, data: bytes | str) -> None:
        """Send to all who are connected."""
        self._loop.call_soon_threadsafe(self._send, data)

    def close(self) -> None:
        """Send what is left, and cut all off."""
        with contextlib.suppress(TimeoutError):
            asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(_STOP_S)
        self._stop()

    def _stop(self) -> None:
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(_STOP_S)

    def _cut_off_slow(self) -> None:
        for client in list(self._clients):
            if client.transport.get_write_buffer_size() > _MOST_WAITING:
                self._clients.discard(client)
                client.transport.abort()

    async def _listen(self, host: str, port: int) -> Any:
        raise NotImplementedError

    def _send(self, data: Any) -> None:
        raise NotImplementedError

    async def _end(self) -> None:
        raise NotImplementedError


class TcpBroadcast(Broadcast):
    """A server of plain bytes; what clients send is ignored."""

    async def _listen(self, host: str, port: int) -> asyncio.Server:
        return await asyncio.start_server(self._connected, host, port)

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients.add(writer)
        with contextlib.suppress(OSError):
            while await reader.read(1024):
                pass
        self._clients.discard(writer)
        writer.close()

    def _send(self, data: bytes) -> None:
        self._cut_off_slow()
        for client in self._clients:
            client.write(data)

    async def _end(self) -> None:
        self._server.close()
        for client in list(self._clients):
            client.close()
            with contextlib.suppress(OSError):
                await client.wait_closed()


class WebSocketBroadcast(Broadcast):
    """A server of WebSocket messages; raises OutputError also if the extra ``websocket`` is missing."""

    def __init__(self, address: str) -> None:
        try:
            from websockets.asyncio import server  # noqa: PLC0415  (an extra)
        except ModuleNotFoundError as error:
            raise OutputError(
                "needs the library websockets, which is not installed",
                file=address,
                remedy="pip install 'vgps[websocket]'",
            ) from error
        self._library = server
        super().__init__(address if "://" in address else f"ws://{address}")

    async def _listen(self, host: str, port: int) -> Any:
        return await self._library.serve(self._connected, host, port)

    async def _connected(self, client: Any) -> None:
        self._clients.add(client)
        await client.wait_closed()
        self._clients.discard(client)

    def _send(self, data: str) -> None:
        self._cut_off_slow()
        self._library.broadcast(self._clients, data)

    async def _end(self) -> None:
        self._server.close()
        await self._server.wait_closed()


class SerialPort:
    """A serial port.

    Args:
        address: A device with or without ``@BAUD``.

    Raises:
        OutputError: It cannot be opened.
    """

    def __init__(self, address: str) -> None:
        device, _, baud = address.partition("@")
        try:
            self._port = serial.Serial(device, int(baud or _BAUD), write_timeout=_MOMENT_S)
        except (OSError, ValueError, serial.SerialException) as error:
            raise OutputError(
                f"cannot be opened ({getattr(error, 'strerror', None) or error})",
                file=address,
                expected="tcp://HOST:PORT to listen there, or a serial port as /dev/ttyUSB0@38400",
            ) from error
        self._waiting: queue.Queue[bytes | None] = queue.Queue(_MOST_QUEUED)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._work, name="serial", daemon=True)
        self._thread.start()

    def send(self, data: bytes) -> None:
        """Queue bytes; they are lost if too many wait."""
        with contextlib.suppress(queue.Full):
            self._waiting.put_nowait(data)

    def close(self) -> None:
        """Write what waits, for a moment, and close the port."""
        with contextlib.suppress(queue.Full):
            self._waiting.put(None, timeout=_MOMENT_S)
        self._thread.join(_MOMENT_S)
        self._closed.set()
        with contextlib.suppress(OSError, serial.SerialException):
            self._port.cancel_write()
            self._thread.join(_STOP_S)
            self._port.close()

    def _work(self) -> None:
        while (data := self._waiting.get()) is not None and not self._closed.is_set():
            with contextlib.suppress(OSError, serial.SerialException):
                self._port.write(data)


def _host_and_port(address: str) -> tuple[str, int]:
    try:
        parts = urlsplit(address)
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if host is None or port is None:
        raise OutputError("is no address", file=address, expected="HOST:PORT, such as 0.0.0.0:8765")
    return host, port
