import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vgps.errors import LandmarkDatabaseError
from vgps.landmarks.database_file import DatabaseFile


def complaint(path: Path) -> str:
    """The message about a file, on opening or on checking it; always one line."""
    with pytest.raises(LandmarkDatabaseError) as caught:
        DatabaseFile(path).verify()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_what_is_no_database_is_refused_with_what_it_is(tmp_path: Path) -> None:
    empty, text, other = (tmp_path / name for name in ("empty", "text", "other.db"))
    empty.write_bytes(b"")
    text.write_text("t_s,wx_rad_s\n0,1\n" * 100)
    with closing(sqlite3.connect(other)) as connection:
        connection.execute("CREATE TABLE meta (x)")
    assert "none.vgps: no such file; expected a landmark database" in complaint(tmp_path / "none.vgps")
    assert "cannot be read" in complaint(tmp_path)
    assert "is empty; expected a landmark database" in complaint(empty)
    assert "is not an SQLite database" in complaint(text)
    assert "is an SQLite database of another program" in complaint(other)


@pytest.mark.parametrize(("version", "remedy"), [(99, "update vgps"), (0, "rebuild it")])
def test_another_schema_version_is_refused_with_what_to_do(
    database_path: Path, version: int, remedy: str
) -> None:
    file = sqlite3.connect(database_path)
    file.execute(f"PRAGMA user_version = {version}")
    file.close()
    assert f"has schema version {version}; expected version 1; {remedy}" in complaint(database_path)


def test_the_file_states_its_schema_version(database_path: Path) -> None:
    assert DatabaseFile(database_path).schema_version == 1


@pytest.mark.parametrize("share", [0.01, 0.3, 0.999])
def test_a_truncated_file_is_refused_with_its_size(database_path: Path, share: float) -> None:
    complete = database_path.read_bytes()
    size = int(share * len(complete))
    database_path.write_bytes(complete[:size])
    assert f"is truncated to {size} bytes; expected {len(complete)} bytes" in complaint(database_path)


@pytest.mark.parametrize(
    ("table", "column"),
    [
        ("meta", "height_m"),
        ("cell", "first_view"),
        ("cell_box", "up_1"),
        ("source", "landmarks"),
        ("keyframe", "width"),
        ("template", "check_sum"),
    ],
)
def test_a_changed_value_in_any_table_is_damage(database_path: Path, table: str, column: str) -> None:
    file = sqlite3.connect(database_path)
    assert file.execute(f"UPDATE {table} SET {column} = {column} + 1").rowcount > 0
    file.commit()
    file.close()
    message = complaint(database_path)
    assert "is damaged" in message and "rebuild it" in message


def test_a_table_meta_without_a_row_is_damage(database_path: Path) -> None:
    file = sqlite3.connect(database_path)
    file.execute("DELETE FROM meta")
    file.commit()
    file.close()
    assert "is damaged (table meta has 0 rows instead of 1)" in complaint(database_path)


def test_a_table_whose_name_is_no_text_is_damage(database_path: Path) -> None:
    """As a flipped bit makes it."""
    file = sqlite3.connect(database_path)
    file.execute("PRAGMA writable_schema = 1")
    file.execute("UPDATE sqlite_master SET name = CAST(name AS BLOB) WHERE name = 'cell'")
    file.commit()
    file.close()
    assert "is not as in the schema" in complaint(database_path)


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_verification_gives_the_same_digest_or_an_error(database_path: Path, place: float, bit: int) -> None:
    whole = database_path.read_bytes()
    at = int(place * len(whole))
    damaged = database_path.with_suffix(".damaged")
    damaged.write_bytes(whole[:at] + bytes([whole[at] ^ (1 << bit)]) + whole[at + 1 :])
    try:
        assert DatabaseFile(damaged).verify() == DatabaseFile(database_path).verify()
    except LandmarkDatabaseError:
        return


@pytest.mark.parametrize(
    ("statements", "found"),
    [
        (
            "ALTER TABLE meta RENAME TO old; CREATE VIEW meta AS WITH RECURSIVE n(i) AS "
            "(SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT old.* FROM n, old",
            "table meta",
        ),
        ("CREATE TRIGGER t AFTER INSERT ON source BEGIN DELETE FROM cell; END", "trigger t"),
        ("ALTER TABLE source ADD COLUMN a AS (zeroblob(9))", "table source hidden a"),
        ("CREATE TABLE more (a)", "table more"),
        ("DROP TABLE keyframe", "table keyframe"),
        ("UPDATE meta SET landmarks = 1000000000000", "impossible numbers in table meta"),
        ("UPDATE meta SET patch_px = 'x'", "impossible numbers in table meta"),
        ("UPDATE meta SET finest_m = 9e999", "impossible numbers in table meta"),
        ("UPDATE meta SET max_views = 1000000", "impossible numbers in table meta"),
    ],
)
def test_a_hostile_schema_or_size_is_refused_before_a_query(
    database_path: Path, statements: str, found: str
) -> None:
    file = sqlite3.connect(database_path)
    file.executescript(statements)
    file.close()
    assert f"is damaged ({found}" in complaint(database_path)
