"""A picture of the viewer, drawn without a window."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from rerun.experimental import ViewerClient

from vgps.errors import ViewerError
from vgps.viewer.run_stream import TIME

_COMMAND = (sys.executable, "-m", "rerun_cli", "--headless", "--hide-welcome-screen")
_SIZE = "1400x875"
_START_S, _DRAW_S, _PAUSE_S = 60.0, 90.0, 2.0
NO_ANSWER = (RuntimeError, ConnectionError, TimeoutError, OSError)
_NO_RENDERER = re.compile(r"render context|graphics adapter|wgpu adapter", re.IGNORECASE)
_DRIVER = "install a Vulkan driver (apt install mesa-vulkan-drivers draws without a graphics card)"
_REMEDY = "write a file with --save F.rrd"


@dataclass(frozen=True)
class _Viewer:
    """A viewer without a window: its process, and the file that takes its standard error."""

    process: "subprocess.Popen[bytes]"
    log: IO[bytes]

    @property
    def has_ended(self) -> bool:
        return self.process.poll() is not None

    def error(self, state: str) -> ViewerError:
        """Return the error for a viewer in this state, with the reason that it printed."""
        self.log.seek(0)
        reason = failure(self.log.read().decode(errors="replace"))
        state = "the viewer ended" if self.has_ended else state
        if reason and _NO_RENDERER.search(reason):
            return ViewerError(f"{state}: no graphics driver ({reason})", remedy=f"{_DRIVER}, or {_REMEDY}")
        return ViewerError(f"{state}: {reason}" if reason else state, remedy=_REMEDY)


def take_screenshot(recording: Path, out: Path, t_s: float) -> None:
    """Draw a recording at the time ``t_s`` of the video as the PNG ``out``.

    Raises:
        ViewerError: The viewer cannot draw on this machine, or does not answer.
    """
    port = _free_port()
    with _headless_viewer(port) as viewer:
        client = _wait_for(viewer, port)
        try:
            client.open(str(recording))
            client.set_time(TIME, duration=t_s, play_state="paused")
            _draw_until_stable(client, out)
        except NO_ANSWER as error:
            state = f"the viewer does not answer ({str(error).splitlines()[0]})"
            raise viewer.error(state) from error
        if not out.is_file():
            raise viewer.error("the viewer drew nothing")


def failure(log: str) -> str:
    """Return the reason for the viewer's end from its log: a panic, or its last error; empty without one."""
    if panic := re.search(r"panicked at [^\n]*?'([^'\n]+)'|panicked at [^\n]*:\n([^\n]+)", log):
        return panic.group(1) or panic.group(2)
    plain = re.sub(r"\x1b\[[0-9;]*m", "", log)  # colours
    errors = [line.split("ERROR", 1)[1].strip() for line in plain.splitlines() if " ERROR " in line]
    return errors[-1] if errors else ""


def _draw_until_stable(client: ViewerClient, out: Path) -> None:
    """Draw until two successive pictures are equal: the viewer does not say when it has loaded everything."""
    before, deadline = b"", time.monotonic() + _DRAW_S
    while time.monotonic() < deadline:
        time.sleep(_PAUSE_S)
        with contextlib.suppress(TimeoutError):  # without a graphics card the first pictures take long
            client.save_screenshot(str(out))
        drawn = out.read_bytes() if out.is_file() else b""
        if drawn and drawn == before:
            return
        before = drawn


@contextlib.contextmanager
def _headless_viewer(port: int) -> Iterator[_Viewer]:
    """Start a viewer without a window that listens on ``port``, and end it afterwards."""
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            [*_COMMAND, "--port", str(port), "--window-size", _SIZE],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=log,
            env={**os.environ, "RERUN_APP_ONLY": "true"},
            start_new_session=True,
        )
        try:
            yield _Viewer(process, log)
        finally:
            # rerun_cli is a launcher: the viewer is its child, in the same process group
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGTERM)
            process.wait()


def _wait_for(viewer: _Viewer, port: int) -> ViewerClient:
    """Return a connection to the viewer once it answers."""
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline and not viewer.has_ended:
        with contextlib.suppress(*NO_ANSWER):
            return connect(port)
        time.sleep(0.3)
    raise viewer.error(f"the viewer did not start within {_START_S:g} s")


def connect(port: int) -> ViewerClient:
    """Connect to the viewer that listens on ``port`` of this machine.

    Raises:
        RuntimeError, OSError: There is none, or it cannot draw.
    """
    client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
    client.get_state()
    return client


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
