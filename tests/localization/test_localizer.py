from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from textured_wall import CAMERA, GYRO_R_CAMERA, ORIGIN, WallDatabase, WallVideo, gyro, pose_at

from vgps.config import Config, LocalizationConfig
from vgps.errors import GeometryError, VideoError
from vgps.localization import localize
from vgps.localization.localizer import Localizer, sensor_warnings
from vgps.model import Recording, Rig
from vgps.solution import FrameState
from vgps.writers.run_folder import write_run

BIAS = (0.02, -0.01, 0.015)
SMALL = {"max_landmarks": 60, "first_landmarks": 30}


def with_tracker(**changes):
    """All settings, with some of the tracker's for a small database."""
    return Config(localization=LocalizationConfig(**changes, **SMALL))


@pytest.fixture(scope="module")
def database():
    return WallDatabase()


def recording_of(video, bias=(0.0, 0.0, 0.0)):
    rig = Rig(gyro_R_camera=GYRO_R_CAMERA, exposure_s=video.exposure_s)
    return Recording(
        path=Path("wall"), video=video, camera=CAMERA, rig=rig, gyro=gyro(video.count / 10, bias)
    )


def errors(poses, t_s):
    true = np.array([pose_at(t) for t in t_s])
    turned = Rotation.from_matrix(poses[:, :3, :3].transpose(0, 2, 1) @ true[:, :3, :3]).magnitude()
    return np.linalg.norm(poses[:, :3, 3] - true[:, :3, 3], axis=1), np.degrees(turned)


@pytest.mark.parametrize("estimator", ["frame", "graph"])
def test_a_shaking_camera_is_held_from_a_start_without_a_pose(database, estimator):
    solution = localize(recording_of(WallVideo(15)), database, with_tracker(estimator=estimator))
    position, rotation = errors(solution.world_T_camera, solution.t_s)
    assert set(solution.state) == {FrameState.TRACKED}
    assert position.max() < 0.08
    assert rotation.max() < 0.5
    assert solution.world_origin == ORIGIN
    assert not solution.warnings
    # every observation is where its landmark projects to, within the limit of an inlier
    seen = solution.observations
    pose = solution.world_T_camera[seen.frame]
    away = solution.landmarks.world_p_landmark[seen.landmark] - pose[:, :3, 3]
    camera_p = (away[:, None] @ pose[:, :3, :3])[:, 0]
    uv = camera_p[:, :2] / camera_p[:, 2:] * 300 + (160, 120)
    assert np.linalg.norm(uv - seen.uv_px, axis=1).max() < 4.5


def test_the_graph_finds_the_gyros_bias(database):
    recording = recording_of(WallVideo(25), BIAS)
    localizer = Localizer(recording, database, LocalizationConfig(**SMALL))
    for frame in recording.video.frames():
        localizer.add(frame.t_s, localizer.undistort(frame.gray))
    np.testing.assert_allclose(localizer.gyro_bias_rad_s, BIAS, atol=0.008)


@pytest.mark.parametrize("estimator", ["frame", "graph"])
def test_black_frames_are_bridged_said_and_left_within_a_second(database, estimator):
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


def test_lost_for_long_it_finds_itself_by_descriptors(database):
    config = LocalizationConfig(coast_s=0.3, **SMALL)
    recording = recording_of(WallVideo(14, black=tuple(range(3, 10))))
    localizer = Localizer(recording, database, config)
    frames = [localizer.add(f.t_s, localizer.undistort(f.gray)) for f in recording.video.frames()]
    # a vain try is followed by a pause of a quarter of a second
    start, again = (i for i, frame in enumerate(frames) if frame.recovered)
    assert start == 0
    assert again in {10, 11, 12}
    assert all(frame.tracked for frame in frames[again:])
    assert not any(frame.tracked for frame in frames[3:10])


def test_a_picture_of_elsewhere_is_no_place(database):
    video = WallVideo(3, black=(0, 1, 2))
    with pytest.raises(GeometryError, match=r"wall.mp4.*landmarks.*expected 6"):
        localize(recording_of(video), database, with_tracker())


def test_without_a_gyro_it_is_said():
    found = sensor_warnings(replace(recording_of(WallVideo(3)), gyro=None), LocalizationConfig())
    assert "no gyro" in found[0]
    assert "constant angular velocity" in found[0]


@pytest.mark.parametrize(
    ("rig", "config", "said"),
    [
        ({"gyro_R_camera": None}, {}, "vgps calibrate-gyro"),
        ({"exposure_s": None}, {}, "no exposure_s"),
        ({}, {"use_gyro": False}, "use_gyro: false"),
    ],
)
def test_what_is_missing_is_said(rig, config, said):
    recording = recording_of(WallVideo(5))
    recording = replace(recording, rig=replace(recording.rig, **rig))
    assert any(said in warning for warning in sensor_warnings(recording, LocalizationConfig(**config)))


def test_nothing_is_said_of_a_whole_recording_or_of_blur_that_is_not_wanted():
    recording = recording_of(WallVideo(5))
    assert sensor_warnings(recording, LocalizationConfig()) == ()
    short = replace(recording, rig=replace(recording.rig, exposure_s=None))
    assert sensor_warnings(short, LocalizationConfig(blur="none")) == ()


def test_a_run_folder_is_written(database, tmp_path):
    solution = localize(recording_of(WallVideo(4, black=(2,))), database, with_tracker())
    write_run(solution, tmp_path / "run")
    assert (tmp_path / "run" / "poses.tum").read_text().count("\n") >= 4
    rows = (tmp_path / "run" / "poses.csv").read_text().splitlines()
    assert "bridged" in rows[3]
    assert "tracked" in rows[2]


def test_a_video_that_breaks_off_is_told_as_the_reader_does(database):
    class Broken(WallVideo):
        def frames(self):
            yield from islice(super().frames(), 2)
            raise VideoError("cannot be decoded", file=self.path)

    with pytest.raises(VideoError, match=r"wall\.mp4: cannot be decoded"):
        localize(recording_of(Broken(5)), database, with_tracker())
