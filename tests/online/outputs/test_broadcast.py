"""Clients of the live mode, over real sockets and a terminal."""

import contextlib
import os
import socket
from contextlib import closing

import pytest
from live_sources import Terminal, until
from websockets.sync.client import connect

from vgps.errors import OutputError
from vgps.online.outputs.broadcast import SerialPort, TcpBroadcast, WebSocketBroadcast


@pytest.fixture
def tcp():
    with closing(TcpBroadcast("tcp://127.0.0.1:0")) as server:
        yield server


def client(server):
    return socket.create_connection(("127.0.0.1", server.port), timeout=0.2)


def received(connection, server, data):
    """Send until it arrives: a client counts once the server has accepted it."""

    def more():
        server.send(data)
        with contextlib.suppress(TimeoutError):
            return data in connection.recv(1 << 16)
        return False

    return until(more)


@pytest.mark.slow
def test_everyone_who_is_connected_gets_the_same(tcp):
    with client(tcp) as first, client(tcp) as second:
        assert received(first, tcp, b"$A\r\n") and received(second, tcp, b"$A\r\n")
        first.sendall(b"what clients send does not matter")
        first.close()  # who leaves does not disturb the others
        assert received(second, tcp, b"$B\r\n")


@pytest.mark.slow
def test_a_client_that_does_not_read_is_cut_off_and_the_others_are_served(tcp):
    with client(tcp) as asleep, client(tcp) as awake:
        assert received(asleep, tcp, b"$A\r\n") and received(awake, tcp, b"$A\r\n")
        block = b"x" * (1 << 16)

        def cut_off():
            tcp.send(block)
            with contextlib.suppress(TimeoutError):
                awake.recv(1 << 20)
            return len(tcp._clients) == 1

        until(cut_off)
        assert received(awake, tcp, b"$B\r\n")


@pytest.mark.slow
def test_closing_sends_what_is_left_and_frees_the_port():
    server = TcpBroadcast("tcp://127.0.0.1:0")
    with client(server) as connection:
        received(connection, server, b"$A\r\n")
        server.send(b"$LAST\r\n")
        server.close()
        rest = b""
        while part := connection.recv(1 << 16):
            rest += part
        assert rest.endswith(b"$LAST\r\n")
    TcpBroadcast(f"tcp://127.0.0.1:{server.port}").close()


def test_a_websocket_gets_messages():
    with (
        closing(WebSocketBroadcast("127.0.0.1:0")) as server,
        connect(f"ws://127.0.0.1:{server.port}") as one,
    ):

        def message():
            server.send('{"type": "pose"}')
            with contextlib.suppress(TimeoutError):
                return one.recv(timeout=0.2)
            return None

        assert until(message) == '{"type": "pose"}'


@pytest.mark.slow
def test_a_serial_port_gets_bytes_and_never_blocks():
    terminal = Terminal()
    with closing(SerialPort(f"{terminal.path}@115200")) as port:
        port.send(b"$A\r\n")
        assert os.read(terminal.master, 100) == b"$A\r\n"
        for _ in range(1000):  # nobody reads
            port.send(b"x" * 1000)
    terminal.close()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1", "tcp://127.0.0.1:99999", "tcp://:"])
def test_an_address_needs_host_and_port(address):
    with pytest.raises(OutputError, match="expected HOST:PORT"):
        TcpBroadcast(address)


def test_a_port_that_is_taken_is_one_line(tcp):
    with pytest.raises(OutputError, match=r"cannot be listened on .*; name a free port"):
        TcpBroadcast(f"tcp://127.0.0.1:{tcp.port}")


@pytest.mark.parametrize("address", ["/dev/no_such_port", "/dev/null@fast"])
def test_a_serial_port_that_cannot_be_opened_is_one_line(address):
    with pytest.raises(OutputError, match="cannot be opened"):
        SerialPort(address)
