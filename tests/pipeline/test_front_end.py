"""Stages A to C over a recording of a room, and what they leave to stage D."""

from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest
from textured_room import (
    CAMERA,
    CONFIG,
    ROOM_ORIGIN,
    path,
    room_control_points,
    room_gps_log,
    room_recording,
)

from vgps.errors import GeometryError, GpsLogError, RecordingError
from vgps.gps.world_frame import world_fixes
from vgps.model import Rig
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.pipeline.front_end import FrontEnd, front_end_of, run_front_end
from vgps.runtime.progress import NoProgress
from vgps.smoothing.context import SmoothingContext

POSES = path(24)


def run(opened, progress=None):
    return run_front_end(opened, CONFIG, progress or NoProgress())


@pytest.fixture(scope="module")
def front_end():
    return run(room_recording(POSES, gps=room_gps_log(POSES)))


@pytest.mark.slow
def test_every_frame_is_in_an_aligned_map(front_end):
    (local_map,) = front_end.maps
    assert local_map.aligned and len(local_map.poses) == 24
    assert np.linalg.norm(local_map.poses[:, :3, 3] - POSES[:, :3, 3], axis=1).max() < 0.1
    np.testing.assert_allclose(front_end.t_s, 0.1 * np.arange(24))
    assert front_end.origin == ROOM_ORIGIN


@pytest.mark.slow
def test_a_flight_whose_start_is_doubtful_is_followed_all_the_same():
    start = CONFIG.start.model_copy(update={"airborne": "yes", "max_chance": 1e-12})
    config = CONFIG.model_copy(update={"start": start})
    found = run_front_end(room_recording(POSES[:12]), config, NoProgress())
    assert len(found.maps) == 1 and np.isfinite(found.maps[0].poses).all()


@pytest.mark.slow
def test_fixes_lie_in_the_world_at_the_times_of_their_own_clock(front_end):
    np.testing.assert_allclose(front_end.fixes.t_s, 0.1 * np.arange(0, 24, 3))
    np.testing.assert_allclose(front_end.fixes.world_p_fix, POSES[::3, :3, 3], atol=1e-3)
    assert front_end.sensors.time_offset_s == 0.0


@pytest.mark.slow
def test_it_is_plain_data(front_end):
    assert isinstance(front_end.maps, tuple) and isinstance(front_end.warnings, tuple)
    for field in fields(FrontEnd):
        with pytest.raises(FrozenInstanceError):
            setattr(front_end, field.name, None)
    assert {"decode", "start", "track", "map", "align", "window"} <= set(front_end.seconds)
    context = front_end.context(CONFIG)
    assert (context.camera, context.config, context.controls) == (CAMERA, CONFIG, front_end.controls)


@pytest.mark.slow
def test_stage_c_has_ended_when_the_front_end_has():
    """A delay longer than the recording: only the end waits for it."""
    window = CONFIG.window.model_copy(update={"delay_frames": 1000})
    config = CONFIG.model_copy(update={"window": window})
    front_end = run_front_end(room_recording(POSES, gps=room_gps_log(POSES)), config, NoProgress())
    assert "wait" in front_end.seconds and "window beside" in front_end.seconds


@pytest.mark.slow
def test_warnings_of_the_video_come_first():
    opened = room_recording(POSES[:12])
    opened.video.warnings = ("two frames could not be decoded",)
    assert run(opened).warnings[0] == "two frames could not be decoded"


def test_what_a_lens_leaves_out_of_the_picture_is_a_warning():
    """An equidistant fisheye whose picture is higher than 85 degrees from the axis at either side."""
    focal_px = CAMERA.height / 2 / np.radians(100.0)
    wide = replace(CAMERA, model="fisheye", fx=focal_px, fy=focal_px, distortion=(0.0,) * 4)
    opened = replace(room_recording(POSES[:2]), camera=wide)
    _, fixes = world_fixes(opened, CONFIG)
    pipeline = FramePipeline(SmoothingContext(wide, CONFIG), np.zeros(3), fixes)
    (warning,) = front_end_of(pipeline, opened, None).warnings
    assert "of the picture is left out" in warning and "85 degrees off the axis" in warning
    assert not front_end_of(pipeline, room_recording(POSES[:2]), None).warnings


@pytest.mark.slow
def test_progress_counts_every_frame_once():
    class Counter(NoProgress):
        seen, total = 0, 0

        def track(self, items, total):
            self.total = total
            for item in items:
                self.seen += 1
                yield item

    counter = Counter()
    run(room_recording(POSES[:12]), counter)
    assert (counter.seen, counter.total) == (12, 12)


def test_a_camera_that_stands_cannot_start_a_map():
    with pytest.raises(GeometryError, match=r"room\.mp4.*hardly moves.*30 common features.*15 px"):
        run(room_recording(np.repeat(POSES[:1], 6, axis=0)))


def test_too_few_fixes_are_refused_before_any_frame_is_read():
    opened = room_recording(POSES, gps=room_gps_log(POSES[:3]))
    opened.video.frames = None
    with pytest.raises(GpsLogError, match=r"usable fixes during the video: 1 .*at least 2"):
        run(opened)


@pytest.mark.slow
def test_control_points_take_the_place_of_gps():
    front_end = run(room_recording(POSES[:16], control_points=room_control_points(POSES, geodetic=True)))
    (local_map,) = front_end.maps
    assert local_map.aligned and len(front_end.fixes) == 0 and len(front_end.controls.frame) == 12
    assert np.linalg.norm(local_map.poses[:, :3, 3] - POSES[:16, :3, 3], axis=1).max() < 0.1


def test_control_points_in_the_world_beside_gps_need_an_origin():
    opened = room_recording(
        POSES, gps=room_gps_log(POSES), control_points=room_control_points(POSES, geodetic=False)
    )
    with pytest.raises(RecordingError, match=r"control_points\.csv.*world_origin"):
        run(replace(opened, rig=Rig()))
