import sys
import time

import numpy as np
import pytest
from live_sources import TcpServer, Terminal, epochs_of, until

from vgps.errors import GpsLogError
from vgps.online.sources.gps_source import GpsSource
from vgps.readers.gps_formats.nmea import read_nmea


@pytest.fixture(scope="module")
def log(recording):
    return (recording / "gps.nmea").read_bytes()


def collected(source, count, seconds=20.0):
    """Return ``count`` fixes, and the notes received meanwhile."""
    fixes, notes = [], []

    def more():
        found, told = source.poll()
        fixes.extend(found)
        notes.extend(told)
        return len(fixes) >= count

    until(more, seconds)
    return fixes, notes


def same_as_log(found, log):
    expected = read_nmea(log).fixes
    np.testing.assert_array_equal([fix.streamed.fix[:4] for fix in found], [fix[:4] for fix in expected])


@pytest.mark.slow
def test_tcp_gives_each_fix_soon_after_its_last_sentence(log):
    sent = []

    def serve(connection):
        for epoch in epochs_of(log):
            connection.sendall(epoch)
            sent.append(time.time())
            time.sleep(0.3)
        time.sleep(5.0)

    server = TcpServer(serve)
    source = GpsSource(f"tcp://127.0.0.1:{server.port}")
    found, _ = collected(source, len(epochs_of(log)))
    same_as_log(found, log)
    for fix, at in zip(found, sent, strict=True):
        assert abs(fix.unix_s - at) < 0.25
    source.close()
    server.close()


@pytest.mark.slow
def test_a_server_that_is_killed_and_started_again_is_read_again(log):
    epochs = epochs_of(log)
    halves = [epochs[:3], epochs[3:]]

    def serve(connection):
        if halves:
            connection.sendall(b"".join(halves.pop(0)))

    server = TcpServer(serve)
    source = GpsSource(f"tcp://127.0.0.1:{server.port}")
    found, notes = collected(source, len(epochs))
    assert server.clients >= 2
    assert len(found) == len(epochs)
    assert any("dropped" in note for note in notes) and any("again" in note for note in notes)
    source.close()
    server.close()


@pytest.mark.slow
def test_reconnection_to_a_server_that_hangs_up_backs_off_with_one_note(log):
    server = TcpServer(lambda connection: None)
    source = GpsSource(f"tcp://127.0.0.1:{server.port}")
    time.sleep(2.5)  # at 0.2, 0.6, 1.4 and 3 s
    _, notes = source.poll()
    source.close()
    assert 2 <= server.clients <= 5
    server.close()
    assert len(notes) == 1 and "dropped" in notes[0]


def test_fixes_come_from_a_serial_port(log):
    terminal = Terminal()
    source = GpsSource(f"{terminal.path}@38400")
    for epoch in epochs_of(log):
        terminal.send(epoch)
        time.sleep(0.02)
    found, _ = collected(source, len(epochs_of(log)))
    same_as_log(found, log)
    source.close()
    terminal.close()


def test_standard_input_ends(log, monkeypatch, tmp_path):
    (tmp_path / "fed").write_bytes(log)
    monkeypatch.setattr(sys, "stdin", (tmp_path / "fed").open(encoding="utf-8"))
    source = GpsSource("-")
    found, notes = collected(source, len(epochs_of(log)))
    same_as_log(found, log)
    assert any("ended" in note for note in notes + source.poll()[1])


def test_gpsd_is_asked_for_sentences(log):
    asked = []

    def serve(connection):
        connection.sendall(b'{"class":"VERSION","release":"3.25"}\r\n')
        asked.append(connection.recv(200))
        connection.sendall(b'{"class":"DEVICES","devices":[]}\r\n' + log)
        time.sleep(2.0)

    server = TcpServer(serve)
    source = GpsSource(f"gpsd://127.0.0.1:{server.port}")
    found, _ = collected(source, len(epochs_of(log)))
    same_as_log(found, log)
    assert asked[0].startswith(b'?WATCH={"enable":true,"nmea":true}')
    source.close()
    server.close()


_UNOPENED = [
    "tcp://127.0.0.1:1",
    "/dev/nosuchport",
    "tcp://",
    "/dev/null@fast",
    "tcp://h:99999",
    "tcp://h:abc",
]
_UNOPENED += ["gpsd://h:70000", "tcp://[::1", "/dev/null@99999999999"]


@pytest.mark.parametrize("address", _UNOPENED)
def test_a_source_that_cannot_be_opened_is_reported_in_one_line(address):
    with pytest.raises(GpsLogError) as caught:
        GpsSource(address)
    assert address in str(caught.value) and "tcp://HOST:PORT" in str(caught.value)
