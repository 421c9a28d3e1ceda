import sqlite3
from dataclasses import fields, replace

import numpy as np
import pytest
from synthetic_landmarks import random_contents

from vgps.landmarks.cells import Cell
from vgps.landmarks.model import Cameras, Source
from vgps.landmarks.schema import (
    TABLES,
    check_sum,
    decode_cell,
    decode_keyframe,
    decode_source,
    digest,
    encode_cell,
    encode_keyframe,
    encode_source,
)
from vgps.model import Camera

CELL = Cell(
    np.array([3, 8]), np.arange(10.0).reshape(2, 5), np.array([1, 2]), np.arange(27.0).reshape(3, 9) / 7
)


def flipped(values: tuple, position: int) -> tuple:
    """The values with one bit of a blob changed."""
    blob = values[position]
    return (*values[:position], bytes([blob[0] ^ 1]) + blob[1:], *values[position + 1 :])


def test_a_cell_is_decoded_as_it_was_encoded() -> None:
    decoded = decode_cell(*encode_cell(CELL))
    for field in fields(Cell):
        np.testing.assert_array_equal(getattr(decoded, field.name), getattr(CELL, field.name))


@pytest.mark.parametrize("position", range(4))
def test_a_changed_cell_is_detected(position: int) -> None:
    with pytest.raises(ValueError, match="check sum"):
        decode_cell(*flipped(encode_cell(CELL), position))


def test_a_keyframe_is_decoded_as_it_was_encoded() -> None:
    keyframe = random_contents().keyframes[0]
    decoded = decode_keyframe(encode_keyframe(keyframe))
    for field in fields(keyframe):
        np.testing.assert_array_equal(getattr(decoded, field.name), getattr(keyframe, field.name))


@pytest.mark.parametrize("position", [0, 1, 2, 3, 6])
def test_a_changed_keyframe_is_detected(position: int) -> None:
    values = flipped(encode_keyframe(random_contents().keyframes[0]), position)
    with pytest.raises(ValueError, match="check sum"):
        decode_keyframe(values)


def test_without_a_check_sum_the_sizes_must_fit() -> None:
    *values, _ = encode_keyframe(random_contents().keyframes[0])
    decode_keyframe((*values, None))
    with pytest.raises(ValueError, match="reshape"):
        decode_keyframe((*values[:2], values[2][:-8], *values[3:], None))


def test_the_check_sum_is_crc_32() -> None:
    assert check_sum(b"1234", b"56789") == 0xCBF43926  # the check value of CRC-32


def test_sources_keep_their_cameras_and_damage_to_these_is_noticed() -> None:
    given = Camera(model="pinhole", width=640, height=480, fx=500.1, fy=500.2, cx=320.0, cy=240.0)
    refined = replace(given, model="opencv", fx=1500.0 / 3.1, distortion=(0.01, -0.02, 0.0, 0.0))
    source = Source("here", "all", 3, "{}", Cameras(given, refined))
    record = encode_source(source)
    assert decode_source(record) == source
    early = Source("here", "all", 3, "{}")
    assert decode_source(encode_source(early)) == early
    *values, cameras, crc = record
    with pytest.raises(ValueError, match="check sum"):
        decode_source((*values, cameras.replace("500.1", "500.3"), crc))


def test_the_digest_covers_every_table_but_not_itself() -> None:
    connection = sqlite3.connect(":memory:")
    connection.executescript(TABLES)
    connection.execute("INSERT INTO meta VALUES (49, 8, 100, 15, 3, 8, 1, 1, 0.1, 0.2, '')")
    connection.execute("INSERT INTO source VALUES (1, 'a', 'all', 1, '{}', NULL, NULL)")
    before = digest(connection)
    connection.execute("UPDATE meta SET digest = 'x'")
    assert digest(connection) == before
    for change in ("UPDATE meta SET views = 2", "UPDATE source SET recording = 'b'"):
        connection.execute(change)
        assert digest(connection) != before
        before = digest(connection)
