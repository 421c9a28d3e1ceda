import sqlite3
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from synthetic_landmarks import CAMERA, random_contents, random_poses
from whole_database import all_views

from tests.support.synthetic_landmarks import plane_normals
from vgps.config import SelectionConfig
from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.model import DatabaseContents, LandmarkViews
from vgps.model import Camera


def written(folder: Path, contents: DatabaseContents) -> Path:
    out = folder / "landmarks.vgps"
    write_database(contents, out)
    return out


def assert_same_views(one: LandmarkViews, other: LandmarkViews) -> None:
    for field in fields(LandmarkViews):
        a, b = getattr(one, field.name), getattr(other, field.name)
        assert a.dtype == b.dtype, field.name
        np.testing.assert_array_equal(a, b, err_msg=field.name)


def brute_force(
    views: LandmarkViews, pose: np.ndarray, camera: Camera, config: SelectionConfig, max_depth_m: float
) -> dict[int, np.ndarray]:
    """Camera of the best view of each landmark that is in the image and has a view that suits; row by row."""
    best: dict[int, tuple[float, np.ndarray]] = {}
    for row in range(len(views)):
        x, y, z = pose[:3, :3].T @ (views.world_p_landmark[row] - pose[:3, 3])
        if not 0.1 < z <= max_depth_m:
            continue
        u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
        if not (-0.5 <= u < camera.width - 0.5 and -0.5 <= v < camera.height - 0.5):
            continue
        here, there = pose[:3, 3], views.world_p_camera[row]
        to_here, to_there = (eye - views.world_p_landmark[row] for eye in (here, there))
        to_here, to_there = to_here / np.linalg.norm(to_here), to_there / np.linalg.norm(to_there)
        angle = np.degrees(np.arccos(np.clip(to_here @ to_there, -1, 1)))
        tilt = np.degrees(np.arccos(np.clip(to_here @ plane_normals(views)[row], -1, 1)))
        sides = np.linalg.norm(views.world_v_column[row]) * np.linalg.norm(views.world_v_row[row])
        octaves = np.log2(z / np.sqrt(camera.fx * camera.fy) / np.sqrt(sides))
        if angle > config.max_view_angle_deg or tilt > config.max_tilt_deg:
            continue
        if not -config.nearer_octaves <= octaves <= config.further_octaves:
            continue
        cost = 2 * (1 - to_here @ to_there) / np.radians(config.angle_unit_deg) ** 2
        cost += (octaves / config.octave_unit) ** 2
        landmark = int(views.landmark[row])
        if landmark not in best or cost < best[landmark][0]:
            best[landmark] = (cost, there)
    return {landmark: camera_p for landmark, (_, camera_p) in best.items()}


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1), spread_m=st.sampled_from([1.0, 30.0, 3e5]))
def test_a_query_finds_the_views_that_brute_force_finds(tmp_path: Path, seed: int, spread_m: float) -> None:
    contents = random_contents(seed, landmarks=120, spread_m=spread_m)
    rng = np.random.default_rng(seed)
    config = SelectionConfig(max_view_angle_deg=90.0)
    with LandmarkDatabase.open(written(tmp_path, contents), config) as database:
        for pose in random_poses(rng, 3, 10.0):
            # near a camera that saw a landmark, so that there is something to find
            pose[:3, 3] += contents.views.world_p_camera[rng.integers(len(contents.views))]
            found = database.views(pose, CAMERA, max_depth_m=100.0)
            expected = brute_force(contents.views, pose, CAMERA, config, 100.0)
            assert sorted(found.landmark.tolist()) == sorted(expected)
            for landmark, camera_p in zip(found.landmark.tolist(), found.world_p_camera, strict=True):
                np.testing.assert_array_equal(camera_p, expected[landmark])


@pytest.mark.slow
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_the_candidates_of_one_place_serve_places_around_it(tmp_path: Path, seed: int) -> None:
    contents = random_contents(seed, landmarks=300, spread_m=8.0)
    rng = np.random.default_rng(seed)
    config = SelectionConfig(region_m=3.0)
    with LandmarkDatabase.open(written(tmp_path, contents), config) as database:
        pose = random_poses(rng, 1, 10.0)[0]
        for camera, max_depth_m in [(CAMERA, 60.0)] * 6 + [(CAMERA, 9.0), (replace(CAMERA, fx=520.0), 9.0)]:
            pose = pose.copy()
            pose[:3, :3] = pose[:3, :3] @ random_poses(rng, 1)[0, :3, :3]
            pose[:3, 3] += rng.normal(scale=1.0, size=3)
            found = database.views(pose, camera, max_depth_m=max_depth_m)
            expected = brute_force(contents.views, pose, camera, config, max_depth_m)
            assert sorted(found.landmark.tolist()) == sorted(expected)


@pytest.mark.slow
def test_equally_reliable_landmarks_are_chosen_by_viewing_direction(tmp_path: Path) -> None:
    contents = random_contents(8, landmarks=9000, max_views=1)
    views = replace(contents.views, sigma_px=np.full(len(contents.views), 0.5))
    pose = random_poses(np.random.default_rng(8), 1, 1.0)[0]
    with LandmarkDatabase.open(written(tmp_path, replace(contents, views=views))) as database:
        angle = {}
        for count in (15, None):
            found = database.views(pose, CAMERA, max_landmarks=count)
            here, there = pose[:3, 3] - found.world_p_landmark, found.world_p_camera - found.world_p_landmark
            cosine = (
                np.sum(here * there, axis=1) / np.linalg.norm(here, axis=1) / np.linalg.norm(there, axis=1)
            )
            angle[count] = np.degrees(np.arccos(cosine))
    assert len(angle[15]) == 15 < len(angle[None])
    assert angle[15].mean() < angle[None].mean() - 3


@pytest.mark.slow
def test_equally_reliable_landmarks_are_ordered_by_the_distance_of_their_views(tmp_path: Path) -> None:
    contents = random_contents(9, landmarks=9000, max_views=1)
    equal = np.full(len(contents.views), 0.5)
    views = replace(contents.views, sigma_px=equal, position_sigma_m=0 * equal)
    pose = random_poses(np.random.default_rng(9), 1, 1.0)[0]
    with LandmarkDatabase.open(written(tmp_path, replace(contents, views=views))) as database:
        found = database.views(pose, CAMERA, max_landmarks=20)
    here, there = pose[:3, 3] - found.world_p_landmark, found.world_p_camera - found.world_p_landmark
    cosine = np.sum(here * there, axis=1) / np.linalg.norm(here, axis=1) / np.linalg.norm(there, axis=1)
    pixel_m = (-here @ pose[:3, 2]) / np.sqrt(CAMERA.fx * CAMERA.fy)
    sides = np.linalg.norm(found.world_v_column, axis=1) * np.linalg.norm(found.world_v_row, axis=1)
    cost = 2 * (1 - cosine) / np.radians(10.0) ** 2 + (np.log2(pixel_m / np.sqrt(sides)) / 0.5) ** 2
    assert len(cost) == 20 and np.ptp(cost) > 1
    assert (np.diff(cost) > -1e-3).all()


def test_a_pose_of_nan_sees_no_landmarks(tmp_path: Path) -> None:
    with LandmarkDatabase.open(written(tmp_path, random_contents())) as database:
        assert len(database.views(np.full((4, 4), np.nan), CAMERA)) == 0
        assert len(database.views(np.full((4, 4), np.nan), CAMERA, max_landmarks=5)) == 0


def test_the_brute_force_finds_something() -> None:
    contents = random_contents(4, landmarks=400)
    counts = [
        len(brute_force(contents.views, pose, CAMERA, SelectionConfig(max_view_angle_deg=90.0), 100.0))
        for pose in random_poses(np.random.default_rng(4), 5, 10.0)
    ]
    assert min(counts) > 0


def test_everything_written_is_read_back_exactly(tmp_path: Path) -> None:
    contents = random_contents(1, landmarks=200)
    _, first = np.unique(contents.views.landmark, return_index=True)
    path = written(tmp_path, contents)
    with LandmarkDatabase.open(path) as database:
        assert (database.landmark_count, database.view_count) == (200, len(contents.views))
        assert (database.patch_px, database.levels) == (5, 3)
        assert database.world_origin == contents.world_origin
        assert database.schema_version == 1
        assert database.sources() == contents.sources
        keyframes = database.keyframes()
        np.testing.assert_array_equal(
            np.sort(database.positions(), axis=0), np.sort(contents.views.world_p_landmark[first], axis=0)
        )
    assert_same_views(all_views(path), contents.views)
    for one, other in zip(keyframes, contents.keyframes, strict=True):
        for field in fields(one):
            np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


def test_a_world_defined_by_control_points_has_no_origin(tmp_path: Path) -> None:
    contents = replace(random_contents(), world_origin=None)
    with LandmarkDatabase.open(written(tmp_path, contents)) as database:
        assert database.world_origin is None


def test_a_camera_far_away_gets_no_views(tmp_path: Path) -> None:
    contents = random_contents()
    pose = np.eye(4)
    pose[:3, 3] = 1e6
    with LandmarkDatabase.open(written(tmp_path, contents)) as database:
        nothing = database.views(pose, CAMERA)
    assert len(nothing) == 0
    assert nothing.templates.shape == (0, 3, 5, 5) and plane_normals(nothing).shape == (0, 3)


def test_max_landmarks_limits_the_number_of_views(tmp_path: Path) -> None:
    contents = random_contents(3, landmarks=4000)
    pose = random_poses(np.random.default_rng(3), 1, 1.0)[0]
    selection = SelectionConfig(nearer_octaves=1.0, further_octaves=2.0)
    with LandmarkDatabase.open(written(tmp_path, contents), selection) as database:
        everything = database.views(pose, CAMERA)
        some = database.views(pose, CAMERA, max_landmarks=20)
        assert_same_views(database.views(pose, CAMERA, max_landmarks=10_000), everything)
    assert len(some) == 20 < len(everything)
    row = {landmark: row for row, landmark in enumerate(everything.landmark.tolist())}
    same = everything.take(np.array([row[landmark] for landmark in some.landmark.tolist()]))
    assert_same_views(some, same)


def test_a_missing_cell_is_reported_by_the_query_that_needs_it(database_path: Path) -> None:
    file = sqlite3.connect(database_path)
    file.execute("DELETE FROM cell WHERE id = 2")
    file.commit()
    file.close()
    with (
        LandmarkDatabase.open(database_path) as database,
        pytest.raises(LandmarkDatabaseError, match=r"\(cell 2\)"),
    ):
        database.positions()


def test_a_changed_keyframe_is_reported_when_it_is_read(database_path: Path) -> None:
    file = sqlite3.connect(database_path)
    (points,) = file.execute("SELECT points FROM keyframe WHERE id = 1").fetchone()
    file.execute("UPDATE keyframe SET points = ? WHERE id = 1", (bytes([points[0] ^ 1]) + points[1:],))
    file.commit()
    file.close()
    with (
        LandmarkDatabase.open(database_path) as database,
        pytest.raises(LandmarkDatabaseError, match=r"\(keyframes\)"),
    ):
        database.keyframes()


def test_early_files_without_cameras_and_check_sums_are_read(database_path: Path) -> None:
    with LandmarkDatabase.open(database_path) as database:
        before = database.keyframes()
    file = sqlite3.connect(database_path)
    file.execute("ALTER TABLE keyframe DROP COLUMN check_sum")
    for column in ("cameras", "check_sum"):
        file.execute(f"ALTER TABLE source DROP COLUMN {column}")
    file.close()
    with LandmarkDatabase.open(database_path) as database:
        after = database.keyframes()
        assert [source.cameras for source in database.sources()] == [None]
    assert len(after) == len(before) > 0
    np.testing.assert_array_equal(after[0].descriptors, before[0].descriptors)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_changes_no_answer_unnoticed(database_path: Path, place: float, bit: int) -> None:
    whole = database_path.read_bytes()
    at = int(place * len(whole))
    damaged = database_path.with_suffix(".damaged")
    damaged.write_bytes(whole[:at] + bytes([whole[at] ^ (1 << bit)]) + whole[at + 1 :])
    with LandmarkDatabase.open(database_path) as database:
        keyframes_before = database.keyframes()
    try:
        after = all_views(damaged)
        with LandmarkDatabase.open(damaged) as database:
            for pose in random_poses(np.random.default_rng(at), 2):
                database.views(pose, CAMERA)
            keyframes = database.keyframes()
    except LandmarkDatabaseError:
        return
    assert_same_views(after, all_views(database_path))
    for one, before in zip(keyframes, keyframes_before, strict=True):
        np.testing.assert_array_equal(one.descriptors, before.descriptors)
        np.testing.assert_array_equal(one.world_p_landmark, before.world_p_landmark)
