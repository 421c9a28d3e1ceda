import threading
from dataclasses import replace

import numpy as np
import pytest

import vgps
from vgps.errors import ConfigError, GeometryError, VideoError
from vgps.online import OnlineSmoother, OnlineState
from vgps.online.replay import fixes_of, replay
from vgps.online.run import run_online
from vgps.readers.trajectory import read_trajectory
from vgps.solution import Verdict

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def opened(recording):
    return vgps.open_recording(recording)


@pytest.fixture(scope="module")
def images(opened):
    return [(frame.t_s, frame.gray) for frame in opened.video.frames()]


def fed(opened, **options):
    """A smoother after the whole recording, and its estimates."""
    smoother, estimates, stop = OnlineSmoother(opened.camera, opened.rig, **options), [], threading.Event()
    run_online(replay(opened, stop), smoother, lambda estimate, _: estimates.append(estimate), stop)
    return smoother, estimates


@pytest.fixture(scope="module")
def online(opened):
    return fed(opened)


def test_the_final_poses_are_those_of_the_last_fit_and_near_those_offline(online, opened, recording):
    smoother, _ = online
    solution = smoother.finish()
    true = read_trajectory(recording / "truth.tum").world_T_camera[:, :3, 3]
    away = np.linalg.norm(solution.world_T_camera[:, :3, 3] - true, axis=1)
    assert away.mean() < 0.1 and solution.georeferenced and solution.fixes.used.all()
    assert abs(solution.sensors.time_offset_s) < 3.0 * solution.sensors.time_offset_sigma_s < 1.5
    # the landmarks lie in the same world: on the walls of the room, as the camera sees them
    path, landmarks = solution.world_T_camera, solution.landmarks
    seen, uv = solution.observations, solution.observations.uv_px
    in_camera = landmarks.world_p_landmark[seen.landmark] - path[seen.frame, :3, 3]
    in_camera = (path[seen.frame, :3, :3].transpose(0, 2, 1) @ in_camera[:, :, None])[:, :, 0]
    pixels = in_camera @ opened.camera.K.T
    off = np.linalg.norm(pixels[:, :2] / pixels[:, 2:] - uv, axis=1)
    assert np.median(off) < 2.0


def test_the_result_has_the_refined_camera(opened):
    smoother = OnlineSmoother(opened.camera, opened.rig)
    assert smoother._session().camera is opened.camera
    stages, refined = smoother._frame_pipeline._stages, replace(opened.camera, fx=500.0)
    smoother._frame_pipeline._stages = stages.with_camera(refined, [])
    assert smoother._session().camera is refined


def test_a_lever_arm_that_nobody_gave_is_in_the_result_with_its_sigmas(opened, online):
    rig = replace(opened.rig, camera_p_antenna=np.zeros(3), antenna_known=False)
    found = fed(replace(opened, rig=rig))[0].finish()
    sigma_m = np.array(found.sensors.antenna_sigma_m)
    assert (np.abs(found.camera_p_antenna - opened.rig.camera_p_antenna) < 3.0 * sigma_m).all()
    assert (sigma_m < 1.5).all() and sigma_m.min() < 0.5 and (found.camera_p_antenna != 0.0).all()
    given = online[0]._session()
    np.testing.assert_array_equal(given.camera_p_antenna, opened.rig.camera_p_antenna)
    assert np.isnan(given.antenna_sigma_m).all()


def test_states_come_in_order_and_no_pose_is_invented(online):
    _, estimates = online
    states = [estimate.state for estimate in estimates]
    order = [OnlineState.STARTING, OnlineState.UNALIGNED, OnlineState.TRACKED]
    assert sorted(set(states), key=states.index) == order
    for estimate in estimates:
        assert estimate.posed == bool(np.isfinite(estimate.global_T_camera).all())
        assert np.isfinite(estimate.local_T_camera).all() == estimate.posed
    aligned = [event.t_s for estimate in estimates for event in estimate.events if event.kind == "aligned"]
    assert aligned == [estimates[states.index(OnlineState.TRACKED)].t_s]


def test_each_pose_is_near_the_truth_as_it_comes(online, recording):
    _, estimates = online
    true = read_trajectory(recording / "truth.tum").world_T_camera[:, :3, 3]
    found = [e for e in estimates if e.posed]
    away = [np.linalg.norm(e.global_T_camera[:3, 3] - true[e.frame]) for e in found]
    assert len(found) > 40 and np.mean(away) < 0.3


def test_every_fix_is_reported_once_while_its_verdict_is_unchanged(online, opened):
    _, estimates = online
    told = [event.details for estimate in estimates for event in estimate.events if event.kind == "fix"]
    assert [entry["verdict"] for entry in told] == ["used"] * len(told)
    times = [entry["fix_t_s"] for entry in told]
    assert len(set(times)) == len(times) >= len(opened.gps) - 1


def aligned_rows(opened, fixes, images, late):
    """Estimates when each fix arrives ``late(k)`` seconds after its time."""
    smoother, estimates = OnlineSmoother(opened.camera, opened.rig), []
    waiting = sorted((fix.t_s + late(k), k, fix) for k, fix in enumerate(fixes))
    for t_s, gray in images:
        while waiting and waiting[0][0] <= t_s:
            assert smoother.add_fix(waiting.pop(0)[2])
        estimates.append(smoother.add_frame(t_s, gray))
        smoother.refine()
    return smoother, estimates


def test_late_and_unordered_fixes_count_at_their_times(opened, images, recording):
    fixes = list(fixes_of(opened.gps))
    # every other fix comes 1.2 s later than the rest, after the one that follows it
    smoother, estimates = aligned_rows(opened, fixes, images, lambda k: 0.4 + 1.2 * (k % 2))
    fix_buffer = smoother._frame_pipeline.fix_buffer
    assert (np.diff(fix_buffer.fixes.t_s) > 0).all() and (np.diff(fix_buffer.number) < 0).any()
    true = read_trajectory(recording / "truth.tum").world_T_camera[:, :3, 3]
    posed = [e for e in estimates if e.posed]
    away = [np.linalg.norm(e.global_T_camera[:3, 3] - true[e.frame]) for e in posed]
    assert len(posed) > 25 and np.mean(away) < 0.3
    assert abs(smoother._frame_pipeline.fix_buffer.sensors.time_offset_s) < 0.1


def test_a_fix_of_the_same_time_or_without_a_position_is_refused(opened):
    smoother = OnlineSmoother(opened.camera, opened.rig)
    fix = next(fixes_of(opened.gps))
    assert smoother.add_fix(fix) and not smoother.add_fix(fix)
    assert not smoother.add_fix(fix._replace(t_s=5.0, height_m=np.nan))


def test_the_first_usable_fix_is_the_origin_where_the_rig_names_none(opened, images):
    smoother = OnlineSmoother(opened.camera, replace(opened.rig, world_origin=None))
    fixes = list(fixes_of(opened.gps))
    smoother.add_fix(fixes[0]._replace(t_s=-3.0))
    smoother.add_fix(fixes[1]._replace(fix_class=vgps.model.FixClass.UNKNOWN))
    assert smoother.add_frame(*images[0]).world_origin is None
    smoother.add_fix(fixes[2])
    origin = smoother.add_frame(*images[1]).world_origin
    assert origin == (fixes[2].latitude_deg, fixes[2].longitude_deg, fixes[2].height_m)


def test_bad_frames_are_reported_with_their_number(opened, images):
    smoother = OnlineSmoother(opened.camera, opened.rig)
    smoother.add_frame(*images[0])
    with pytest.raises(VideoError, match=r"frame 1.*later than 0\.0"):
        smoother.add_frame(0.0, images[1][1])
    with pytest.raises(VideoError, match=r"frame 1.*\(240, 320\)"):
        smoother.add_frame(0.1, images[1][1][:100])
    with pytest.raises(GeometryError, match="no frame has a pose"):
        smoother.finish()
    with pytest.raises(ConfigError, match="keep_all"):
        smoother.finish(stage_d=True)


def test_what_a_pose_does_not_need_comes_after_it_and_before_the_next(opened, images, monkeypatch):
    smoother, done = OnlineSmoother(opened.camera, opened.rig), []
    monkeypatch.setattr(smoother._frame_pipeline, "map_frame", lambda: done.append("stage B"))
    monkeypatch.setattr(smoother._places, "see", lambda image: done.append(image) or [])
    (first_s, first), (second_s, second) = images[:2]
    smoother.add_frame(first_s, first)
    assert not done
    smoother.add_frame(second_s, second)
    assert done[0] == "stage B"
    assert done[1] is first
    assert not any(one is second for one in done)


def test_without_fixes_the_result_is_not_georeferenced(opened, images):
    smoother = OnlineSmoother(opened.camera, opened.rig)
    states = [smoother.add_frame(*image).state for image in images[:40]]
    assert states[-1] is OnlineState.UNALIGNED
    solution = smoother.finish()
    assert not solution.georeferenced and np.isfinite(solution.world_T_camera).all()


def test_with_everything_kept_stage_d_gives_what_smooth_gives(brief):
    opened = vgps.open_recording(brief)
    config = vgps.Config(intrinsics={"tolerance_sigmas": 0.05})  # from either start, close to the same
    smoother, _ = fed(opened, keep_all=True, config=config)
    online, offline = smoother.finish(stage_d=True), vgps.smooth(opened, config)
    # the same minimum from another start
    np.testing.assert_allclose(online.world_T_camera, offline.world_T_camera, atol=1e-3)
    assert (
        set(online.fixes.verdict) == {Verdict.USED} and online.gps.line.tolist() == offline.gps.line.tolist()
    )
    assert np.isfinite(online.sigma_position_m).all()
