"""A picture of the viewer."""

from pathlib import Path

import av
import numpy as np
import pytest

from vgps.errors import ViewerError
from vgps.solution import Solution
from vgps.viewer import inspect_run


@pytest.mark.slow
def test_a_picture_is_drawn_without_a_window(solution: Solution, tmp_path: Path) -> None:
    try:
        inspect_run(solution, screenshot=tmp_path / "run.png")
    except ViewerError as error:
        pytest.skip(f"nothing here can draw: {error}")
    with av.open(str(tmp_path / "run.png")) as picture:
        pixels = next(picture.decode(video=0)).to_ndarray(format="rgb24")
    assert pixels.shape[0] >= 800
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 100
