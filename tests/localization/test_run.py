from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from angles import apart_deg
from textured_wall import CAMERA, ORIGIN, WallVideo, picture, pose_at, recording_of

from vgps.config import Config, IntrinsicsConfig, LocalizationConfig
from vgps.errors import GeometryError, VideoError
from vgps.geometry import project
from vgps.landmarks.model import Cameras
from vgps.localization import localize
from vgps.localization.lens_refinement import LensCheck
from vgps.model import Frame
from vgps.rolling_shutter import row_poses
from vgps.smoothing.calibration.refined_camera import RefinedCamera
from vgps.solution import FrameState
from vgps.writers.run_folder import write_run

pytestmark = pytest.mark.slow

SMALL = {"max_landmarks": 60, "first_landmarks": 30}


def with_tracker(**changes):
    """All settings, with some of the tracker's for a small database."""
    return Config(localization=LocalizationConfig(**changes, **SMALL))


def errors(poses, t_s):
    true = np.array([pose_at(t) for t in t_s])
    return np.linalg.norm(poses[:, :3, 3] - true[:, :3, 3], axis=1), apart_deg(poses, true)


@pytest.mark.parametrize("estimator", ["frame", "graph"])
def test_a_shaking_camera_is_tracked_from_an_unknown_pose(database, estimator):
    solution = localize(recording_of(WallVideo(15)), database, with_tracker(estimator=estimator))
    position, rotation = errors(solution.world_T_camera, solution.t_s)
    assert set(solution.state) == {FrameState.TRACKED}
    assert position.max() < 0.08
    assert rotation.max() < 0.5
    assert solution.world_origin == ORIGIN
    assert not solution.warnings
    # every observation lies at its landmark's projection, within the limit of an inlier
    seen = solution.observations
    pose = solution.world_T_camera[seen.frame]
    away = solution.landmarks.world_p_landmark[seen.landmark] - pose[:, :3, 3]
    camera_p = (away[:, None] @ pose[:, :3, :3])[:, 0]
    uv = camera_p[:, :2] / camera_p[:, 2:] * 300 + (160, 120)
    assert np.linalg.norm(uv - seen.uv_px, axis=1).max() < 4.5


@pytest.mark.parametrize("use_gyro", [True, False])
def test_a_rolling_shutter_is_tracked_like_a_global_one(database, use_gyro):
    video = WallVideo(15, exposure_s=0.0, readout_s=0.03)
    known = replace(recording_of(video), camera=replace(CAMERA, readout_s=0.03))
    config = with_tracker(use_gyro=use_gyro)
    modelled, ignored = (
        localize(recording, database, config) for recording in (known, replace(known, camera=CAMERA))
    )
    position, rotation = errors(modelled.world_T_camera, modelled.t_s)
    assert set(modelled.state) == {FrameState.TRACKED}
    settled = slice(0 if use_gyro else 4, None)  # without a gyro a start does not know how the camera turns
    assert position[settled].max() < 0.08
    assert rotation[settled].max() < 0.5
    assert position.mean() < 0.6 * errors(ignored.world_T_camera, ignored.t_s)[0].mean()
    # observations are where the pictures show them
    seen = modelled.observations
    poses = row_poses(modelled.camera, modelled.t_s, modelled.world_T_camera, seen.frame, seen.uv_px)
    points = modelled.landmarks.world_p_landmark[seen.landmark]
    away = project(CAMERA.K, poses, points[:, None])[0][:, 0] - seen.uv_px
    assert np.median(np.linalg.norm(away, axis=1)) < 0.5


@pytest.mark.parametrize("estimator", ["frame", "graph"])
def test_black_frames_are_bridged_and_reported(database, estimator):
    black = tuple(range(5, 13))
    solution = localize(recording_of(WallVideo(18, black=black)), database, with_tracker(estimator=estimator))
    bridged = {i for i, state in enumerate(solution.state) if state == FrameState.BRIDGED}
    assert bridged == set(black)
    position, rotation = errors(solution.world_T_camera, solution.t_s)
    assert position.max() < 0.15
    assert rotation.max() < 0.5
    assert np.isnan(solution.sigma_position_m[6]).all()
    assert "8 of 18 frames" in solution.warnings[0]
    assert "5 to 12 (0.50 to 1.20 s)" in solution.warnings[0]


def test_a_calibration_that_the_run_of_the_map_refined_is_replaced_by_the_refined_one(database):
    given = replace(CAMERA, fx=315.0, fy=315.0)
    refined_by_run = replace(database, cameras=Cameras(given, CAMERA))
    recording = replace(recording_of(WallVideo(8)), camera=given)
    solution = localize(recording, refined_by_run, with_tracker())
    assert solution.camera == CAMERA
    assert errors(solution.world_T_camera, solution.t_s)[0].max() < 0.08
    other = localize(replace(recording, camera=CAMERA), refined_by_run, with_tracker())
    np.testing.assert_array_equal(other.world_T_camera, solution.world_T_camera)


def test_a_video_of_another_place_is_refused(database):
    video = WallVideo(3, black=(0, 1, 2))
    with pytest.raises(GeometryError, match=r"wall.mp4.*landmarks.*expected 6"):
        localize(recording_of(video), database, with_tracker())


def test_a_run_folder_is_written(database, tmp_path):
    solution = localize(recording_of(WallVideo(4, black=(2,))), database, with_tracker())
    write_run(solution, tmp_path / "run")
    assert (tmp_path / "run" / "poses.tum").read_text().count("\n") >= 4
    rows = (tmp_path / "run" / "poses.csv").read_text().splitlines()
    assert "bridged" in rows[3]
    assert "tracked" in rows[2]


def test_a_fault_of_the_video_is_passed_on(database):
    class Broken(WallVideo):
        def frames(self):
            yield from islice(super().frames(), 2)
            raise VideoError("cannot be decoded", file=self.path)

    with pytest.raises(VideoError, match=r"wall\.mp4: cannot be decoded"):
        localize(recording_of(Broken(5)), database, with_tracker())


def test_a_camera_lost_for_its_speed_is_reported_with_the_setting_to_change(database):
    class Fast(WallVideo):
        def frames(self):
            # from -3 m to 3 m in 0.2 s; the frame between shows nothing, as if it were beyond the windows
            for k, x in enumerate((-3.0, None, 3.0)):
                pose = np.eye(4)
                pose[0, 3] = x or 0.0
                image = np.full((240, 320), 16.0) if x is None else picture(pose)
                yield Frame(k, k / 10, np.round(image).astype(np.uint8))

    solution = localize(recording_of(Fast(3)), database, with_tracker(recovery_pause_s=0.0))
    assert solution.state.count(FrameState.TRACKED) == 2
    assert "moved at up to 30 m/s: set localization.max_speed_m_s to 40" in solution.warnings[-1]


def test_with_a_calibration_that_landmarks_contradict_all_frames_are_tracked_again(database, monkeypatch):
    wrong = replace(CAMERA, fx=315.0, fy=315.0)
    refined = RefinedCamera(CAMERA, {"focal": 0.001, "cx": 0.5, "cy": 0.5}, 2, True)

    def told(lens, camera, frames):
        if lens.found is not None or len(frames) < 4:
            return None
        lens.found = refined
        return refined.camera

    monkeypatch.setattr(LensCheck, "better", told)
    recording = replace(recording_of(WallVideo(8)), camera=wrong)
    solution, right = (
        localize(one, database, with_tracker()) for one in (recording, recording_of(WallVideo(8)))
    )
    np.testing.assert_array_equal(solution.world_T_camera, right.world_T_camera)
    assert solution.camera == CAMERA
    assert solution.sensors.camera_sigma == refined.sigma
    assert "fx 315.0 -> 300.0 px" in solution.warnings[0]
    held = with_tracker().model_copy(update={"intrinsics": IntrinsicsConfig(refine="no")})
    kept = localize(recording, database, held)
    assert kept.camera == wrong and not kept.warnings
