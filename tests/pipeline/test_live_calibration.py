"""The calibration is refined while frames come: the map and all that follows see the new camera."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from room_pipeline import CAMERA as ROOM_CAMERA
from room_pipeline import CONFIG as ROOM_CONFIG
from room_pipeline import exact_fixes, room
from synthetic_bundle import ANTENNA
from synthetic_map import CAMERA, map_of, scene

from vgps.camera import undistort
from vgps.config import BatchConfig, Config, IntrinsicsConfig, WindowConfig
from vgps.errors import GeometryError
from vgps.geometry import project, travelled
from vgps.gps.fix_buffer import FixBuffer
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.map_update import MapUpdate
from vgps.model import Camera
from vgps.pipeline.frame_pipeline import FramePipeline
from vgps.pipeline.live_calibration import LiveCalibration
from vgps.pipeline.map_builder import MapBuilder
from vgps.pipeline.stage_c import StageC
from vgps.pipeline.window_worker import WindowWorker
from vgps.runtime.timing import StageTimer
from vgps.smoothing.context import SmoothingContext
from vgps.smoothing.scene.other_calibration import undistorted_again
from vgps.smoothing.stage_c.window import optimise_window

CONFIG = Config(
    window=WindowConfig(length_frames=40),
    batch=BatchConfig(video_sigma_scale=1.0),  # so that few frames show it
    intrinsics=IntrinsicsConfig(distortion_sigma=0.1),
)
WRONG = replace(CAMERA, model="opencv", cx=CAMERA.cx + 4.0, distortion=(0.1, 0.0, 0.0, 0.0))
SENSORS = Sensors.fixed(ANTENNA)


def map_seen_by(camera: Camera, stop=(-1, 0)):
    made = map_of(scene(disturbed=0.0)[0], 0, 59, stop=stop)
    made.apply(MapUpdate(undistorted=undistorted_again(camera, CAMERA)))
    return made


def misfit_px(local_map, camera):
    seen = local_map.observations()
    uv_px, _ = project(camera.K, local_map.poses[seen.frame], local_map.points[seen.landmark, None])
    return float(np.median(np.linalg.norm(uv_px[:, 0] - seen.uv_px, axis=1)))


def calibrated(camera, local_map, config=CONFIG, next_due_frame=None):
    made = LiveCalibration(SmoothingContext(camera, config, calibrates=True))
    made.update(local_map, camera, SENSORS)
    made._job = replace(made._job, due_frame=local_map.next_frame)
    made._due_frame = next_due_frame or made._due_frame
    made.update(local_map, camera, SENSORS)
    return made


@pytest.mark.slow
def test_a_map_follows_the_camera_that_its_frames_show():
    local_map = map_seen_by(WRONG)
    made = calibrated(WRONG, local_map)
    assert made.camera.cx == pytest.approx(CAMERA.cx, abs=3.0)
    assert abs(made.camera.distortion[0]) < 0.05
    assert "the calibration was refined" in made.warnings[0]
    before, poses = misfit_px(local_map, WRONG), local_map.poses.copy()
    local_map.apply(made.resolved(local_map, WRONG, SENSORS))
    assert misfit_px(local_map, made.camera) < 0.5 * before
    np.testing.assert_allclose(local_map.poses[0, :3, 3], poses[0, :3, 3], atol=1e-9)  # it stays in place
    step = [np.linalg.norm(one[1, :3, 3] - one[0, :3, 3]) for one in (local_map.poses, poses)]
    assert step[0] == pytest.approx(step[1], rel=0.2)  # and keeps its scale there


@pytest.mark.slow
def test_a_map_keeps_its_scale_after_a_stop_longer_than_what_is_kept():
    local_map = map_seen_by(WRONG, stop=(19, 150))
    made, before = calibrated(WRONG, local_map), local_map.poses.copy()
    local_map.apply(made.resolved(local_map, WRONG, SENSORS))
    way = [travelled(poses[150:, :3, 3])[-1] for poses in (local_map.poses, before)]
    assert way[0] == pytest.approx(way[1], rel=0.05)
    stop = local_map.poses[19:170, :3, 3]
    np.testing.assert_allclose(stop, np.broadcast_to(stop[0], stop.shape), atol=1e-2)


@pytest.mark.slow
def test_a_camera_that_fits_stays():
    local_map = map_seen_by(CAMERA)
    made = calibrated(CAMERA, local_map, Config(window=CONFIG.window))
    assert len(made._known) == 2 and made.camera is CAMERA and not made.warnings


@pytest.mark.slow
def test_frames_of_before_are_the_prior_of_those_after():
    local_map = map_seen_by(WRONG)
    made = calibrated(WRONG, local_map)
    assert [frame for frame, _ in made._known] == [0, 60]
    first, second = (known.sigma for _, known in made._known)
    assert second[3] < first[3] and made._due_frame == 90


@pytest.mark.slow
def test_what_is_begun_before_the_map_follows_reads_its_observations_by_the_camera_of_the_map():
    """As after a long stop, when one calibration is taken over and the next is due."""
    made = calibrated(WRONG, map_seen_by(WRONG), next_due_frame=60)
    assert abs(made.camera.distortion[0]) < 0.05
    assert abs(made._job.found.result().camera.distortion[0]) < 0.05


def fail(*_):
    raise GeometryError("not determined")


@pytest.mark.slow
def test_a_calibration_counts_when_it_is_due_and_the_next_takes_half_as_many_frames_more(monkeypatch):
    monkeypatch.setattr(LiveCalibration, "_found", fail)
    made = LiveCalibration(SmoothingContext(WRONG, CONFIG, calibrates=True))
    whole = scene(disturbed=0.0)[0]

    def begun(first, last):
        made.update(map_of(whole, first, last), WRONG, SENSORS)
        return made._job

    assert begun(0, 38) is None
    job = begun(0, 39)
    assert job.due_frame == 55 and begun(0, 53) is job and begun(0, 54) is None
    assert begun(0, 58) is None and begun(30, 59) is None  # a map of half as many
    assert begun(0, 59).due_frame == 75


def test_frames_count_once_for_a_calibration(monkeypatch):
    """Its prior is that of frames before all of its own."""
    monkeypatch.setattr(LiveCalibration, "_found", fail)
    made = LiveCalibration(SmoothingContext(WRONG, CONFIG, calibrates=True))
    (_, given), whole = made._known[0], scene(disturbed=0.0)[0]
    made._known += [(20, replace(given)), (21, replace(given))]
    made.update(map_of(whole, 20, 59), WRONG, SENSORS)
    assert made._job.prior is made._known[1][1]


def test_a_calibration_that_fails_changes_nothing(monkeypatch):
    monkeypatch.setattr(LiveCalibration, "_found", fail)
    made = calibrated(WRONG, map_seen_by(WRONG))
    assert made.camera is WRONG and len(made._known) == 1


@pytest.mark.slow
@pytest.mark.parametrize("calibrates", [True, False])
def test_tracking_goes_on_with_the_refined_camera(calibrates):
    wrong = replace(ROOM_CAMERA, model="opencv", distortion=(0.1, 0.0, 0.0, 0.0))
    window = ROOM_CONFIG.window.model_copy(update={"delay_frames": 3, "every_frames": 4})
    known = IntrinsicsConfig(distortion_sigma=0.1)
    config = ROOM_CONFIG.model_copy(
        update={"window": window, "intrinsics": known, "batch": BatchConfig(video_sigma_scale=1.0)}
    )
    context = SmoothingContext(wrong, config, calibrates=calibrates)
    made = FramePipeline(context, np.zeros(3), exact_fixes())
    for frame in room():
        made.add_frame(frame)
    made.finish_window()
    assert (made.camera is wrong) is not calibrates and len(made.maps) == 1
    seen = undistort(made.camera, made.current.raw_uv_px)
    np.testing.assert_allclose(made.current.last_uv_px, seen, atol=1e-6)
    assert any("the calibration was refined" in one for one in made.warnings) is calibrates
    if calibrates:
        assert abs(made.camera.distortion[0]) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize("at_once", [True, False])
def test_a_window_that_fails_leaves_the_camera_to_the_next(monkeypatch, at_once):
    local_map = map_seen_by(WRONG)
    worker = WindowWorker(
        SmoothingContext(WRONG, CONFIG, calibrates=True),
        FixBuffer(Fixes.empty(), ANTENNA, CONFIG),
        StageTimer(),
    )
    stage_c = worker._stage_c
    stage_c._calibration = calibrated(WRONG, local_map)
    monkeypatch.setattr(StageC, "_correct", lambda *_: 1 / 0)
    worker.start(local_map)
    with pytest.raises(ZeroDivisionError):
        worker.finish()
    assert worker.camera is WRONG
    monkeypatch.undo()
    before, misfits = misfit_px(local_map, WRONG), []

    def seen(local_map, fixes, antenna, context, tolerance):
        misfits.append(misfit_px(local_map, context.camera))
        return optimise_window(local_map, fixes, antenna, context, tolerance)

    monkeypatch.setattr("vgps.pipeline.stage_c.optimise_window", seen)
    if at_once:
        worker.optimise(local_map)
    else:
        worker.start(local_map)
        worker.finish()
    assert worker.camera is stage_c._calibration.camera is not WRONG
    assert misfits[0] < 0.5 * before
    assert misfit_px(local_map, WRONG) > misfit_px(local_map, worker.camera)


@pytest.mark.slow
def test_a_map_that_cannot_follow_keeps_its_camera(monkeypatch):
    local_map, fix_buffer = map_seen_by(WRONG), FixBuffer(Fixes.empty(), ANTENNA, CONFIG)
    stage_c = StageC(SmoothingContext(WRONG, CONFIG, calibrates=True), StageTimer())
    stage_c._calibration.camera = CAMERA
    monkeypatch.setattr(LiveCalibration, "resolved", fail)
    assert stage_c.run(local_map, fix_buffer, WRONG) == ()
    assert stage_c.camera is stage_c._calibration.camera is WRONG


def test_isam2_begins_again_with_the_refined_camera(monkeypatch):
    window = CONFIG.window.model_copy(update={"solver": "isam2"})
    config = CONFIG.model_copy(update={"window": window})
    stage_c = StageC(SmoothingContext(WRONG, config, calibrates=True), StageTimer())
    stage_c._calibration.camera = CAMERA
    update = MapUpdate(undistorted=undistorted_again(CAMERA, WRONG))
    monkeypatch.setattr(LiveCalibration, "resolved", lambda *_: update)
    stage_c.run(map_seen_by(WRONG), FixBuffer(Fixes.empty(), ANTENNA, config), WRONG)
    assert stage_c._isam2._context.camera is stage_c.camera is CAMERA


@pytest.mark.slow
def test_all_maps_and_the_tracker_go_on_with_the_refined_camera():
    made = FramePipeline(SmoothingContext(ROOM_CAMERA, ROOM_CONFIG), np.zeros(3), exact_fixes())
    for frame in islice(room(), 12):
        made.add_frame(frame)
    (seen,) = made.maps
    earlier, coming = seen.snapshot(), seen.snapshot()
    made.maps.append(earlier)
    maps = made._maps
    maps.following = MapBuilder(local_map=coming, view_image=maps.current.view_image)
    views, before = seen.views, made.tracker.state([seen])
    refined = replace(ROOM_CAMERA, model="opencv", distortion=(0.05, 0.0, 0.0, 0.0))
    made._worker._context = replace(made._worker._context, camera=refined)
    made._use_camera(seen)
    assert made.camera is refined
    np.testing.assert_array_equal(seen.views, views)
    assert not np.allclose(earlier.last_uv_px, views[:, -1])
    for other in (earlier, coming):
        np.testing.assert_allclose(other.last_uv_px, undistort(refined, views[:, -1]), atol=1e-9)
    after = made.tracker.state([seen])
    assert len(after["patches"]) == 1 and after["patches"][0][1] is before["patches"][0][1]
    assert after["static"] is before["static"]
