import shutil
from dataclasses import fields, replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from synthetic_run import BENT, FRAMES, PINHOLE, WallRun, make_wall_run, poses, render, texture

from tests.support.synthetic_landmarks import plane_normals
from vgps.config import LandmarksConfig
from vgps.errors import LandmarkDatabaseError, RecordingError
from vgps.landmarks.build import build_database, build_from_runs
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.model import DatabaseContents
from vgps.model import FocalChanges, GeodeticPoint
from vgps.readers.recording import open_recording
from vgps.readers.views.steady import steady
from vgps.solution import FrameState
from vgps.writers.run_folder import write_run


@pytest.fixture(scope="module")
def contents(wall: WallRun) -> DatabaseContents:
    return built(wall)


def built(run: WallRun, frames="all", **changes) -> DatabaseContents:
    recording = open_recording(run.recording, with_gps=False)
    return build_database(run.solution, recording, frames, LandmarksConfig(**changes))


def frame_of(places: np.ndarray) -> np.ndarray:
    """Which frame was taken from each place (N, 3)."""
    return np.linalg.norm(places[:, None] - poses()[None, :, :3, 3], axis=2).argmin(axis=1)


@pytest.mark.slow
def test_a_template_pixel_shows_the_point_that_the_axes_name(contents: DatabaseContents) -> None:
    views, wall = contents.views, texture()
    frames = frame_of(views.world_p_camera)
    for row in range(0, len(views), 29):
        pose = poses()[frames[row]]
        image = render(PINHOLE, pose, wall).astype(np.float32)
        step = np.arange(-7, 8)
        point = views.world_p_landmark[row] + np.add.outer(
            step[:, None] * views.world_v_row[row], np.zeros(1)
        ).reshape(15, 1, 3)
        point = point + step[None, :, None] * views.world_v_column[row]
        camera_p = (point - pose[:3, 3]) @ pose[:3, :3]
        u = PINHOLE.fx * camera_p[..., 0] / camera_p[..., 2] + PINHOLE.cx
        v = PINHOLE.fy * camera_p[..., 1] / camera_p[..., 2] + PINHOLE.cy
        shown = cv2.remap(image, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR)
        np.testing.assert_allclose(views.templates[row, 0], shown, atol=0.51)


@pytest.mark.slow
def test_landmarks_keep_their_positions_and_look_towards_the_camera(
    wall: WallRun, contents: DatabaseContents
) -> None:
    views = contents.views
    points = wall.solution.landmarks
    np.testing.assert_array_equal(views.world_p_landmark, points.world_p_landmark[views.landmark])
    np.testing.assert_array_equal(views.sigma_px, points.sigma_px[views.landmark])
    np.testing.assert_allclose(
        plane_normals(views), -poses()[frame_of(views.world_p_camera)][:, :3, 2], atol=1e-12
    )
    assert ((views.position_sigma_m > 0.05) & (views.position_sigma_m < 1.2)).all()


@pytest.mark.slow
def test_views_are_few_and_spread(contents: DatabaseContents) -> None:
    counts = np.unique(contents.views.landmark, return_counts=True)[1]
    assert counts.max() == 8 and len(counts) > 80
    frames = frame_of(contents.views.world_p_camera)
    first = np.minimum.reduceat(frames, np.cumsum(counts) - counts)
    last = np.maximum.reduceat(frames, np.cumsum(counts) - counts)
    assert (last - first)[counts == 8].min() >= 8


@pytest.mark.parametrize(("frames", "remainder"), [("even", 0), ("odd", 1)])
def test_of_even_or_odd_frames_these_alone_give_views_and_keyframes(
    wall: WallRun, frames: str, remainder: int
) -> None:
    half = built(wall, frames)
    assert (frame_of(half.views.world_p_camera) % 2 == remainder).all()
    keys = frame_of(np.array([key.world_T_camera[:3, 3] for key in half.keyframes]))
    assert keys.tolist() == [remainder, 10 + remainder, 20 + remainder]
    assert half.sources[0].frames == frames


def test_frames_without_a_pose_of_their_own_give_nothing(wall: WallRun) -> None:
    state = tuple(FrameState.BRIDGED if i < 12 else FrameState.TRACKED for i in range(FRAMES))
    bridged = replace(wall, solution=replace(wall.solution, state=state))
    assert frame_of(built(bridged).views.world_p_camera).min() == 12


@pytest.mark.slow
def test_landmarks_poorly_known_are_left_out(wall: WallRun, contents: DatabaseContents) -> None:
    everything = set(contents.views.landmark.tolist())
    sigma = wall.solution.landmarks.sigma_px
    strict = set(built(wall, max_sigma_px=0.45).views.landmark.tolist())
    assert strict == {landmark for landmark in everything if sigma[landmark] <= 0.45}

    count = np.bincount(wall.solution.observations.landmark, minlength=150)
    often = set(built(wall, min_observations=20).views.landmark.tolist())
    assert often == {landmark for landmark in everything if count[landmark] >= 20} != everything

    sure = built(wall, max_relative_sigma=0.03).views
    assert 0 < len(set(sure.landmark.tolist())) < len(everything)
    assert sure.position_sigma_m.max() <= 0.03 * 12


@pytest.mark.slow
def test_of_a_lens_that_bends_templates_are_of_the_undistorted_image(tmp_path: Path) -> None:
    bent = built(make_wall_run(tmp_path, BENT)).views
    wall = texture()
    row = int(np.argmax(np.abs(bent.world_p_landmark[:, 0] - bent.world_p_camera[:, 0])))
    pose = poses()[frame_of(bent.world_p_camera[row : row + 1])[0]]
    flat = replace(BENT, model="pinhole", distortion=())
    image = render(flat, pose, wall).astype(np.float32)
    camera_p = (bent.world_p_landmark[row] - pose[:3, 3]) @ pose[:3, :3]
    uv = camera_p[:2] / camera_p[2] * (flat.fx, flat.fy) + (flat.cx, flat.cy)
    shown = cv2.getRectSubPix(image, (15, 15), uv)
    # sampled twice, so a little smoother
    assert np.abs(bent.templates[row, 0] - shown).mean() < 4
    assert np.corrcoef(bent.templates[row, 0].ravel(), shown.ravel())[0, 1] > 0.99


@pytest.mark.slow
def test_a_keyframe_places_features_beside_their_landmarks(contents: DatabaseContents) -> None:
    key = contents.keyframes[1]
    position = dict(zip(contents.views.landmark, contents.views.world_p_landmark, strict=True))
    own = np.array([position[landmark] for landmark in key.landmark])
    assert len(key.landmark) > 20 and key.descriptors.shape == (len(key.landmark), 32)
    assert (np.diff(key.landmark) >= 0).all()
    pose = key.world_T_camera
    there, beside = ((points - pose[:3, 3]) @ pose[:3, :3] for points in (own, key.world_p_landmark))
    np.testing.assert_allclose(beside[:, 2], there[:, 2], atol=1e-9)
    offset_px = (beside - there)[:, :2] / there[:, 2:] * (PINHOLE.fx, PINHOLE.fy)
    assert np.linalg.norm(offset_px, axis=1).max() <= 4
    assert key.thumbnail.shape == (48, 64)


@pytest.mark.slow
def test_written_and_asked_it_shows_what_a_frame_saw(contents: DatabaseContents, tmp_path: Path) -> None:
    write_database(contents, tmp_path / "wall.vgps")
    with LandmarkDatabase.open(tmp_path / "wall.vgps") as database:
        seen = database.views(poses()[10], PINHOLE)
        back = database.keyframes()
    assert len(seen) > 40 and len(set(seen.landmark.tolist())) == len(seen)
    far = np.linalg.norm(seen.world_p_camera - poses()[10, :3, 3], axis=1)
    assert np.median(far) < 0.5
    for field in fields(back[0]):
        np.testing.assert_array_equal(
            getattr(back[0], field.name), getattr(contents.keyframes[0], field.name)
        )


def complaint(run: WallRun, **changes) -> str:
    with pytest.raises(LandmarkDatabaseError) as caught:
        built(replace(run, solution=replace(run.solution, **changes)))
    return str(caught.value)


def test_a_run_that_does_not_fit_is_refused(wall: WallRun) -> None:
    solution = wall.solution
    assert "the run is not georeferenced" in complaint(wall, georeferenced=False)
    assert "is not the video of the run: it has 24 frames; expected 23 frames" in complaint(
        wall, t_s=solution.t_s[:-1]
    )
    assert "other frame times" in complaint(wall, t_s=solution.t_s * 1.1)
    frame_s = solution.t_s[1] - solution.t_s[0]
    built(replace(wall, solution=replace(solution, t_s=solution.t_s + 0.4 * frame_s)))  # a converted video
    lapse = replace(solution, t_s=9.0 * solution.t_s, sensors=replace(solution.sensors, video_speed=9.0))
    built(replace(wall, solution=lapse))
    wide = replace(solution.camera, width=640)
    assert "it has 320 x 240 pixels" in complaint(wall, camera=wide)
    vague = replace(solution.landmarks, sigma_px=np.full(150, 5.0))
    assert "none of 150 landmarks is reliable" in complaint(wall, landmarks=vague)


@pytest.mark.slow
def test_two_runs_of_different_origins_meet_in_one_world(wall: WallRun, tmp_path: Path) -> None:
    moved = replace(wall.solution, world_origin=GeodeticPoint(49.011, 8.4166, 163.0))
    write_run(moved, tmp_path / "other")
    both = build_from_runs([wall.run, tmp_path / "other"])
    half = len(both.views) // 2
    apart = both.views.world_p_landmark[half:] - both.views.world_p_landmark[:half]
    # a ten-thousandth of a degree of longitude at 49 degrees north, to the east
    np.testing.assert_allclose(apart, np.tile([7.32, 0, 0], (half, 1)), atol=0.02)
    assert len(both.sources) == 2


def test_templates_of_a_camera_that_zooms_are_of_pictures_of_one_focal_length(wall: WallRun) -> None:
    """The camera that the database keeps is one of other videos, too, without the changes of this one."""
    centre = PINHOLE.cx, PINHOLE.cy
    changes = FocalChanges((0.0, 1e3), (0.05, 0.05), centre)
    camera = replace(wall.solution.camera, focal_changes=changes)
    recording = open_recording(wall.recording, with_gps=False)
    found = build_database(replace(wall.solution, camera=camera), recording)
    (source,) = found.sources
    assert source.cameras is not None
    assert source.cameras.refined == wall.solution.camera
    assert source.cameras.given == recording.camera
    scaled = steady(recording, changes)
    expected = build_database(replace(wall.solution, camera=camera), scaled)
    np.testing.assert_array_equal(found.views.templates, expected.views.templates)
    as_they_are = build_database(wall.solution, recording)
    assert np.mean(found.views.templates != as_they_are.views.templates) > 0.5


def test_no_run_at_all_is_refused() -> None:
    with pytest.raises(LandmarkDatabaseError, match="no run is given"):
        build_from_runs([])


@pytest.mark.slow
def test_a_recording_that_moved_is_named(wall: WallRun, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(wall.recording, elsewhere)
    gone = tmp_path / "gone"
    write_run(replace(wall.solution, recording=tmp_path / "nowhere"), gone)
    with pytest.raises(RecordingError, match="nowhere: no such recording"):
        build_from_runs([gone])
    found = build_from_runs([gone], recording=elsewhere)
    assert found.sources[0].recording == str(elsewhere)
    with pytest.raises(LandmarkDatabaseError, match="one recording for 2 runs"):
        build_from_runs([gone, gone], recording=elsewhere)
    unknown = tmp_path / "unknown"
    write_run(replace(wall.solution, recording=None), unknown)
    with pytest.raises(LandmarkDatabaseError, match="names no recording"):
        build_from_runs([unknown])
