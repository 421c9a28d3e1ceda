"""The verb with its listeners, read as their clients would."""

import contextlib
import io
import json
import socket
import subprocess
import sys
import threading

import pytest
from live_sources import until
from pynmeagps import VALCKSUM, NMEAReader
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def tried(opened):
    """What opens once the other side listens."""

    def once():
        with contextlib.suppress(OSError):
            return opened()
        return None

    return until(once)


@pytest.mark.slow
def test_the_verb_serves_receivers_and_websockets(brief):
    nmea, web = free_port(), free_port()
    words = [sys.executable, "-m", "vgps", "online", brief, "--realtime"]
    words += ["--nmea", f"tcp://127.0.0.1:{nmea}", "--websocket", f"127.0.0.1:{web}"]
    heard = []

    def listen():
        with tried(lambda: connect(f"ws://127.0.0.1:{web}")) as client, contextlib.suppress(ConnectionClosed):
            heard.extend(client)

    listener = threading.Thread(target=listen)
    with subprocess.Popen(list(map(str, words)), stdout=subprocess.PIPE, text=True) as process:
        listener.start()
        data = b""
        with tried(lambda: socket.create_connection(("127.0.0.1", nmea))) as client:
            drained = threading.Thread(target=process.stdout.read)
            drained.start()
            while part := client.recv(1 << 16):
                data += part
        assert process.wait() == 0
    listener.join(20.0)
    read = [one for _, one in NMEAReader(io.BytesIO(data), validate=VALCKSUM, quitonerror=2)]
    last = next(one for one in reversed(read) if one.msgID == "GGA")
    pose = json.loads(heard[-1])
    assert pose["type"] == "pose" and pose["frame"] == 44
    assert last.quality in {4, 5} and last.lat == pytest.approx(pose["global"]["latitude_deg"], abs=1e-8)
    assert read[-1].msgID == "HDT"
    assert read[-1].headingT == pytest.approx(pose["global"]["heading_deg"], abs=1e-3)
    assert pose["utc"][11:16] == f"{last.time:%H:%M}"
