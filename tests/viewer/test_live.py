"""The live view, read back from a file instead of a window."""

import numpy as np
import pytest
import rerun as rr
from reading_back import Logged

from vgps.errors import ViewerError
from vgps.model import FixClass
from vgps.solution import Verdict
from vgps.viewer import colours, open_live_view
from vgps.viewer.live import LiveView


@pytest.fixture(scope="module")
def logged(tmp_path_factory):
    file, poses = tmp_path_factory.mktemp("live") / "live.rrd", np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 3] = [0.0, np.nan, 2.0, 3.0]
    stream = rr.RecordingStream("vgps")
    stream.save(file)
    view = LiveView(stream)
    for k, pose in enumerate(poses):
        view.pose(0.05 * k, pose, np.array([0.1, 0.2, np.nan]))
        view.latency(0.05 * k, 0.012)
        view.image(0.05 * k, np.full((300, 1280), 7, np.uint8))
    view.fix(0.1, np.array([2.0, 0.5, 0.0]), FixClass.RTK_FLOAT, Verdict.REJECTED)
    view.message(0.1, "rtk_float of 0.10 s rejected")
    view.close()
    stream.disconnect()
    return Logged(file)


def test_the_path_goes_on_where_there_are_poses(logged):
    strips = logged.rows("/world/path", "LineStrips3D:strips")
    np.testing.assert_allclose(strips, [[[[2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]]])
    assert logged.times_s("/world/path") == pytest.approx([0.15])
    assert len(logged.rows("/world/camera", "Transform3D:translation")) == 3


def test_fixes_have_the_colour_of_their_verdict(logged):
    ((colour,),) = logged.rows("/world/fixes", "Points3D:colors")
    assert colour == int.from_bytes(bytes(colours.REJECTED), "big")
    assert logged.rows("/messages", "TextLog:text") == [["rtk_float of 0.10 s rejected"]]


def test_numbers_and_some_small_pictures(logged):
    assert logged.rows("/latency", "Scalars:scalars") == [[12.0]] * 4
    assert logged.rows("/sigma/north", "Scalars:scalars") == [[0.2]] * 3
    assert logged.rows("/sigma/up", "Scalars:scalars") == []
    assert logged.times_s("/world/camera/image") == pytest.approx([0.0, 0.1])


def test_without_a_display_the_error_says_what_to_do(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(ViewerError, match=r"no display .* leave --rerun out"):
        open_live_view()
