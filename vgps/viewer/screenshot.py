"""A picture of the viewer, drawn without a window."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from rerun.experimental import ViewerClient

from vgps.errors import ViewerError
from vgps.viewer.run_stream import TIME

_SIZE = "1400x875"
_START_S, _DRAW_S, _PAUSE_S = 60.0, 90.0, 2.0
NO_ANSWER = (RuntimeError, ConnectionError, TimeoutError, OSError)
_REMEDY = (
    "install a Vulkan driver (apt install mesa-vulkan-drivers draws without a graphics card), or use --save"
)


def take_screenshot(recording: Path, out: Path, t_s: float) -> None:
    """Draw a recording at the time ``t_s`` of the video as the PNG ``out``.

    Raises:
        ViewerError: The viewer cannot draw on this machine, or does not answer.
    """
    with _headless_viewer() as (client, process):
        try:
            client.open(str(recording))
            client.set_time(TIME, duration=t_s, play_state="paused")
            _draw_until_stable(client, out)
        except NO_ANSWER as error:
            ended = process.poll() is not None
            state = "ended" if ended else f"does not answer ({str(error).splitlines()[0]})"
            raise ViewerError(f"the viewer {state}", file=out, remedy=_REMEDY) from error
    if not out.is_file():
        raise ViewerError("the viewer drew nothing", file=out, remedy=_REMEDY)


def _draw_until_stable(client: ViewerClient, out: Path) -> None:
    """Draw until two successive pictures are equal: the viewer does not say when it has loaded everything."""
    before, until = b"", time.monotonic() + _DRAW_S
    while time.monotonic() < until:
        time.sleep(_PAUSE_S)
        with contextlib.suppress(TimeoutError):  # without a graphics card the first pictures take long
            client.save_screenshot(str(out))
        drawn = out.read_bytes() if out.is_file() else b""
        if drawn and drawn == before:
            return
        before = drawn


@contextlib.contextmanager
def _headless_viewer() -> Iterator[tuple[ViewerClient, "subprocess.Popen[bytes]"]]:
    """Start a viewer without a window; yield a connection to it and its process, and end it afterwards."""
    port = _free_port()
    command = [sys.executable, "-m", "rerun_cli", "--headless", "--hide-welcome-screen"]
    process = subprocess.Popen(
        [*command, "--port", str(port), "--window-size", _SIZE],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "RERUN_APP_ONLY": "true"},
        start_new_session=True,
    )
    try:
        yield _wait_for_viewer(port, process), process
    finally:
        # rerun_cli is a launcher: the viewer is its child, in the same process group
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.wait()


def _wait_for_viewer(port: int, process: "subprocess.Popen[bytes]") -> ViewerClient:
    until = time.monotonic() + _START_S
    while time.monotonic() < until and process.poll() is None:
        with contextlib.suppress(*NO_ANSWER):
            return connect(port)
        time.sleep(0.3)
    state = "ended at once" if process.poll() is not None else f"did not start within {_START_S:g} s"
    raise ViewerError(f"the viewer {state}", remedy=_REMEDY)


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
