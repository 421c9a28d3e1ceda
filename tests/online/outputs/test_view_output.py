import io
from dataclasses import replace

import numpy as np
import pytest

import vgps
from vgps.errors import RecordingError
from vgps.model import FixClass
from vgps.online.estimate import OnlineEstimate, OnlineEvent, OnlineState
from vgps.online.outputs.output import PoseOutput
from vgps.online.outputs.view_output import ViewOutput
from vgps.online.session import OnlineOptions, pose_recording
from vgps.solution import Verdict

ESTIMATE = OnlineEstimate(
    frame=0,
    t_s=1.5,
    state=OnlineState.TRACKED,
    global_T_camera=np.eye(4),
    local_T_camera=2.0 * np.eye(4),
    sigma_position_m=np.full(3, 0.1),
    sigma_rotation_rad=np.full(3, 0.01),
    world_origin=None,
    events=(),
    seconds=0.01,
)
FIX = OnlineEvent(
    1.5,
    "fix",
    "rtk_fix of 1.20 s rejected",
    {"fix_t_s": 1.2, "class": "rtk_fix", "verdict": "rejected", "east_m": 1.0, "north_m": 2.0, "up_m": 3.0},
)


class Recorder:
    """A view that remembers what it was shown."""

    def __init__(self):
        self.shown = []

    def __getattr__(self, name):
        return lambda *values: self.shown.append((name, *values))


def test_a_view_gets_fixes_where_they_lie_messages_and_the_best_pose():
    view = Recorder()
    note = OnlineEvent(1.4, "note", "the connection dropped")
    ViewOutput(view).write(replace(ESTIMATE, events=(note, FIX)), 0.02)
    names = [name for name, *_ in view.shown]
    assert names == ["message", "message", "fix", "pose", "latency"]
    _, fix_t_s, position, kind, verdict = view.shown[2]
    assert (fix_t_s, position.tolist(), kind) == (1.2, [1.0, 2.0, 3.0], FixClass.RTK_FIX)
    assert verdict is Verdict.REJECTED
    np.testing.assert_array_equal(view.shown[3][2], np.eye(4))
    assert view.shown[4] == ("latency", 1.5, 0.02)


class EnoughError(Exception):
    """The view has seen enough."""


class Watching(PoseOutput):
    """An output that remembers what it was given, and ends the session after three frames."""

    def __init__(self):
        self.given = []

    def write(self, estimate, latency_s):
        self.given.append(("pose", estimate.t_s))

    def show(self, t_s, gray):
        self.given.append(("image", t_s))
        if len(self.given) == 6:
            raise EnoughError

    def close(self):
        self.given.append(("closed", None))


@pytest.mark.slow
def test_a_view_sees_every_frame_after_its_pose_and_is_closed(data_dir):
    view, lines = Watching(), io.StringIO()
    options = OnlineOptions(config=vgps.Config(), gps="gps_fix.nmea", open_view=lambda: view)
    with pytest.raises(EnoughError):
        pose_recording(data_dir / "kitti07", options, stream=lines)
    kinds, times_s = zip(*view.given, strict=True)
    assert kinds == ("pose", "image") * 3 + ("closed",) and times_s[0:6:2] == times_s[1:6:2]
    assert lines.getvalue().count('"type": "pose"') == 3


def test_no_view_opens_for_a_recording_that_is_not_there(tmp_path):
    options = OnlineOptions(config=vgps.Config(), open_view=lambda: pytest.fail("a view was opened"))
    with pytest.raises(RecordingError):
        pose_recording(tmp_path / "gone", options)
