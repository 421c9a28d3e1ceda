import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from synthetic_landmarks import CAMERA, random_contents, random_poses

from vgps.errors import LandmarkDatabaseError, RunFolderError
from vgps.landmarks.database import LandmarkDatabase
from vgps.landmarks.database_writer import write_database
from vgps.landmarks.model import DatabaseContents


@pytest.fixture
def good(tmp_path: Path) -> Path:
    out = tmp_path / "landmarks.vgps"
    write_database(random_contents(landmarks=300), out)
    return out


def complaint(path: Path) -> str:
    with pytest.raises(LandmarkDatabaseError) as caught, LandmarkDatabase.open(path) as database:
        database.verify()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_no_such_file(tmp_path: Path) -> None:
    assert "none.vgps: no such file; expected a landmark database" in complaint(tmp_path / "none.vgps")


def test_a_folder(tmp_path: Path) -> None:
    assert "cannot be read" in complaint(tmp_path)


def test_an_empty_file(tmp_path: Path) -> None:
    (tmp_path / "empty").write_bytes(b"")
    assert "is empty; expected a landmark database" in complaint(tmp_path / "empty")


def test_text(tmp_path: Path) -> None:
    (tmp_path / "text").write_text("t_s,wx_rad_s\n0,1\n" * 100)
    assert "is no SQLite database" in complaint(tmp_path / "text")


def test_a_database_of_another_program(tmp_path: Path) -> None:
    other = sqlite3.connect(tmp_path / "other.db")
    other.execute("CREATE TABLE meta (x)")
    other.close()
    assert "is an SQLite database of another program" in complaint(tmp_path / "other.db")


@pytest.mark.parametrize(("version", "remedy"), [(99, "update vgps"), (0, "build it again")])
def test_another_version(good: Path, version: int, remedy: str) -> None:
    file = sqlite3.connect(good)
    file.execute(f"PRAGMA user_version = {version}")
    file.close()
    assert f"has version {version}; expected version 1; {remedy}" in complaint(good)


@pytest.mark.parametrize("share", [0.01, 0.3, 0.999])
def test_a_file_cut_short(good: Path, share: float) -> None:
    whole = good.read_bytes()
    good.write_bytes(whole[: int(share * len(whole))])
    assert "is cut short" in complaint(good)


@pytest.mark.parametrize("table", ["meta", "cell", "cell_box", "source", "keyframe", "template"])
def test_a_value_that_was_changed(good: Path, table: str) -> None:
    column = {"meta": "height_m", "cell": "first_view", "cell_box": "up_1", "source": "landmarks"}
    file = sqlite3.connect(good)
    name = column.get(table, {"keyframe": "width", "template": "check_sum"}.get(table, ""))
    assert file.execute(f"UPDATE {table} SET {name} = {name} + 1").rowcount > 0
    file.commit()
    file.close()
    assert "is damaged" in complaint(good) and "build it again" in complaint(good)


def test_a_missing_row_is_told_by_the_query_that_needs_it(good: Path) -> None:
    file = sqlite3.connect(good)
    file.execute("DELETE FROM template")
    file.execute("DELETE FROM cell WHERE id = 2")
    file.commit()
    file.close()
    with LandmarkDatabase.open(good) as database, pytest.raises(LandmarkDatabaseError, match=r"\(cell 2\)"):
        database.positions()
    with LandmarkDatabase.open(good) as database, pytest.raises(LandmarkDatabaseError, match="is damaged"):
        database.all_views()


def test_a_keyframe_that_was_changed_is_told_where_it_is_asked(good: Path) -> None:
    file = sqlite3.connect(good)
    (points,) = file.execute("SELECT points FROM keyframe WHERE id = 1").fetchone()
    assert len(points) > 8
    file.execute("UPDATE keyframe SET points = ? WHERE id = 1", (bytes([points[0] ^ 1]) + points[1:],))
    file.commit()
    file.close()
    with (
        LandmarkDatabase.open(good) as database,
        pytest.raises(LandmarkDatabaseError, match=r"\(keyframes\)"),
    ):
        database.keyframes()


def test_keyframes_without_check_sums_are_read(good: Path) -> None:
    with LandmarkDatabase.open(good) as database:
        before = database.keyframes()
    file = sqlite3.connect(good)
    file.execute("ALTER TABLE keyframe DROP COLUMN check_sum")
    file.close()
    with LandmarkDatabase.open(good) as database:
        after = database.keyframes()
    assert len(after) == len(before) > 0
    np.testing.assert_array_equal(after[0].descriptors, before[0].descriptors)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_a_flipped_bit_is_found_and_never_shown(good: Path, place: float, bit: int) -> None:
    whole = good.read_bytes()
    at = int(place * len(whole))
    hurt = good.with_suffix(".hurt")
    hurt.write_bytes(whole[:at] + bytes([whole[at] ^ (1 << bit)]) + whole[at + 1 :])
    with LandmarkDatabase.open(good) as database:
        before, keyframes_before = database.all_views(), database.keyframes()
    try:
        with LandmarkDatabase.open(hurt) as database:
            after = database.all_views()
            for pose in random_poses(np.random.default_rng(at), 2):
                database.views(pose, CAMERA)
            keyframes = database.keyframes()
    except LandmarkDatabaseError:
        return
    for one, was in zip(keyframes, keyframes_before, strict=True):
        np.testing.assert_array_equal(one.descriptors, was.descriptors)
        np.testing.assert_array_equal(one.world_p_landmark, was.world_p_landmark)
    for name in ("world_p_landmark", "world_p_camera", "world_v_row", "templates"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_a_failure_leaves_the_earlier_file_and_nothing_else(good: Path) -> None:
    before = good.read_bytes()
    contents = random_contents(1)
    broken = replace(contents, keyframes=(None,))  # type: ignore[arg-type]
    with pytest.raises(AttributeError):
        write_database(broken, good)
    assert good.read_bytes() == before
    assert list(good.parent.iterdir()) == [good]


def test_a_new_file_replaces_one_that_is_being_read(good: Path) -> None:
    with LandmarkDatabase.open(good) as database:
        write_database(random_contents(7, landmarks=20), good)
        assert len(database.positions()) == database.landmark_count == 300
    with LandmarkDatabase.open(good) as database:
        assert database.landmark_count == 20


def test_equal_contents_give_equal_bytes(good: Path) -> None:
    again = good.with_name("again.vgps")
    write_database(random_contents(landmarks=300), again)
    assert again.read_bytes() == good.read_bytes()


def test_nothing_to_write(tmp_path: Path) -> None:
    contents = random_contents()
    views = replace(contents.views, **{name: values[:0] for name, values in vars(contents.views).items()})
    with pytest.raises(LandmarkDatabaseError, match="no landmark is left"):
        write_database(DatabaseContents(contents.world_origin, views, (), ()), tmp_path / "x")
    with pytest.raises(RunFolderError, match="is a folder"):
        write_database(contents, tmp_path)
    assert not list(tmp_path.iterdir())
