"""A picture of the viewer, and what is reported if there is none."""

import os
import sys
from pathlib import Path

import av
import numpy as np
import pytest

from vgps.errors import ViewerError
from vgps.solution import Solution
from vgps.viewer import inspect_run, screenshot
from vgps.viewer.screenshot import failure

NO_ADAPTER = "thread 'main' panicked at 'Failed to create render state: No graphics adapter was found'"


def vulkan_drivers() -> list[Path]:
    """The Vulkan drivers that are installed here, as the loader finds them."""
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return [Path(name) for name in named.split(os.pathsep)]
    places = ("/etc", "/usr/share", "/usr/local/share", Path.home() / ".local/share")
    return [file for place in places for file in Path(place, "vulkan/icd.d").glob("*.json")]


@pytest.mark.slow
@pytest.mark.skipif(
    sys.platform == "linux" and not vulkan_drivers(),
    reason="no Vulkan driver: no .json in vulkan/icd.d; apt install mesa-vulkan-drivers",
)
def test_a_picture_is_drawn_without_a_window(solution: Solution, tmp_path: Path) -> None:
    inspect_run(solution, screenshot=tmp_path / "run.png")
    with av.open(str(tmp_path / "run.png")) as picture:
        pixels = next(picture.decode(video=0)).to_ndarray(format="rgb24")
    assert pixels.shape[0] >= 800
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 100


def test_the_reason_is_the_panic_or_the_last_error() -> None:
    start = "\x1b[2m2026-01-01T00:00:00Z\x1b[0m \x1b[32m INFO\x1b[0m re_grpc_server: Listening\n"
    assert failure(f"{start}\n{NO_ADAPTER}\nwgpu.rs:77\n") == (
        "Failed to create render state: No graphics adapter was found"
    )
    assert failure("thread 'main' panicked at src/app.rs:7:5:\nindex out of bounds\nnote: run") == (
        "index out of bounds"
    )
    assert failure(f"{start}\x1b[31mERROR\x1b[0m first\n 2026Z \x1b[31mERROR\x1b[0m port in use\n") == (
        "port in use"
    )
    assert failure(start) == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("last_words", "message"),
    [
        (
            NO_ADAPTER,
            r"^the viewer ended: no graphics driver \(.*\); install a Vulkan driver .*--save F\.rrd",
        ),
        ("thread 'main' panicked at 'out of memory'", r"^the viewer ended: out of memory; write a file"),
        ("", r"^the viewer ended; write a file with --save F\.rrd"),
    ],
)
def test_a_viewer_that_ends_is_reported_with_its_reason(
    solution: Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, last_words: str, message: str
) -> None:
    script = f"import sys; sys.exit({last_words!r})"
    monkeypatch.setattr(screenshot, "_COMMAND", (sys.executable, "-c", script))
    with pytest.raises(ViewerError, match=message):
        inspect_run(solution, screenshot=tmp_path / "run.png")
    assert list(tmp_path.iterdir()) == []
