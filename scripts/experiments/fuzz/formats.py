"""Damage inside binary formats, after which lengths and check sums are right again."""

import io
import random
import re
import sqlite3
import struct
import zipfile
from typing import Any

import numpy as np
import pynmeagps
import pyubx2

from scripts.experiments.fuzz.mutators import damage_bytes
from vgps.landmarks.schema import check_sum, digest

_UBX = re.compile(rb"\xb5\x62..(..)", re.DOTALL)
_SENTENCE = re.compile(rb"\$([^$*\r\n]+)\*[0-9A-F]{2}")
_FIELDS = (
    b"",
    b"-1",
    b"nan",
    b"9" * 20,
    b"1e400",
    b"999999.99",
    b"0",
    b"N",
    b"Z",
    b"\xff",
    b"235960",
    b"320229",
)
_BOXES = re.compile(
    rb"stts|ctts|stsz|stsc|stco|stss|elst|mdhd|mvhd|tkhd|stsd|avc1|avcC|gpmd|djmd|camm|tx3g|hdlr|moov|trak|mdat"
)
_COUNTS = (0, 1, 2, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 0x10000000)
_DTYPES = ("<f8", "<f4", "<i8", "|u1", "<U9", "|b1", "<c16", ">f8", "|S4", "<M8[s]", "|V8")
_SHAPES = (
    "()",
    "(0,)",
    "(1,)",
    "(-1,)",
    "(99999999999,)",
    "(3, 3)",
    "(0, 4, 4)",
    "(2, 0)",
    "(1000000, 1000000)",
)
_COMPRESSIONS = (*[zipfile.ZIP_STORED] * 5, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
_NUMBERS = (np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0, 2.0**62)
_TABLES = ("meta", "source", "cell", "cell_box", "template", "keyframe")
_SQL_VALUES = ("NULL", "-1", "0", "1", "1e300", "9223372036854775807", "'x'", "x'00'", "zeroblob(999)", "''")
_LONGEST_QUERY = 1_000_000  # instructions of SQLite
_HOSTILE_SQL = (
    "CREATE TRIGGER t AFTER INSERT ON source BEGIN DELETE FROM cell; END",
    "ALTER TABLE {table} RENAME TO old; CREATE VIEW {table} AS SELECT * FROM old",
    "ALTER TABLE {table} RENAME TO old; CREATE VIEW {table} AS WITH RECURSIVE n(i) AS "
    "(SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT * FROM n, old",
    "ALTER TABLE {table} ADD COLUMN more GENERATED ALWAYS AS (randomblob(999))",
    "DROP TABLE {table}",
    "DELETE FROM {table}",
    "INSERT INTO {table} SELECT * FROM {table}",
    "CREATE TABLE sheep (a); INSERT INTO sheep VALUES (zeroblob(100000))",
    "PRAGMA user_version = 7",
    "PRAGMA application_id = 7",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET sql = replace(sql, 'BLOB', 'TEXT')",
    "PRAGMA writable_schema = ON; UPDATE sqlite_master SET rootpage = 2 WHERE name = '{table}'",
)


def damage_ubx(data: bytes, rng: random.Random) -> bytes:
    """Damage the payload of a message and correct its check sum."""
    match = rng.choice(list(_UBX.finditer(data)))
    end = match.end() + int.from_bytes(match[1], "little")
    payload = bytearray(data[match.end() : end])
    for _ in range(rng.choice((1, 2, 8))):
        payload[rng.randrange(len(payload))] = rng.choice((0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)))
    if rng.random() < 0.1:
        payload = payload[: rng.randrange(len(payload))]
    body = data[match.start() + 2 : match.start() + 4] + len(payload).to_bytes(2, "little") + payload
    total: bytes = pyubx2.calc_checksum(body)
    return data[: match.start()] + b"\xb5\x62" + body + total + data[end + 2 :]


def damage_nmea(data: bytes, rng: random.Random) -> bytes:
    """Replace fields of sentences and correct their check sums."""
    for match in sorted(
        rng.sample(list(_SENTENCE.finditer(data)), rng.choice((1, 2, 3))), key=lambda m: -m.start()
    ):
        fields = match[1].split(b",")
        fields[rng.randrange(len(fields))] = rng.choice(_FIELDS)
        if rng.random() < 0.1:
            fields = fields[: rng.randrange(1, len(fields) + 1)]
        body = b",".join(fields)
        total = pynmeagps.calc_checksum(body.decode("latin-1")).encode()
        data = data[: match.start()] + b"$" + body + b"*" + total + data[match.end() :]
    return data


def damage_gpmf(data: bytes, rng: random.Random) -> bytes:
    """Change type, size, count or values of entries, at any depth, whose outer lengths stay right."""
    entries, at = [], 0
    while at + 8 <= len(data):
        key, kind, size, count = struct.unpack_from(">4sBBH", data, at)
        length = size * count
        entries.append([key, kind, size, count, data[at + 8 : at + 8 + length]])
        at += 8 + (length + 3) // 4 * 4
    index = rng.randrange(len(entries))
    entry = entries[index]
    if entry[1] == 0 and rng.random() < 0.95:
        entry[4] = damage_gpmf(entry[4], rng)
        entry[2], entry[3] = (1, len(entry[4])) if len(entry[4]) < 65536 else (4, len(entry[4]) // 4)
        return b"".join(map(_packed, entries))
    match rng.randrange(7):
        case 0:
            entry[1] = rng.choice(b"bBsSlLjJfdcUFGqQ?\0\xff")
        case 1:
            entry[2] = rng.choice((0, 1, 2, 4, 8, 255, rng.randrange(256)))
        case 2:
            entry[3] = rng.choice((0, 1, 2, 65535, rng.randrange(65536)))
        case 3:
            entry[0] = rng.choice(
                (b"GPS5", b"GPS9", b"GYRO", b"SHUT", b"CORI", b"SCAL", b"TYPE", b"STMP", b"ORIN")
            )
        case 4:
            del entries[index]
        case 5:
            entries.insert(rng.randrange(len(entries)), entry)
        case _:
            entry[4] = damage_bytes(entry[4], rng)[: len(entry[4])].ljust(len(entry[4]), b"\xff")
    return b"".join(map(_packed, entries))


def _packed(entry: list[Any]) -> bytes:
    key, kind, size, count, body = entry
    return b"".join((struct.pack(">4sBBH", key, kind, size, count), body, b"\0" * (-len(body) % 4)))


def damage_boxes(data: bytes, rng: random.Random) -> bytes:
    """Overwrite numbers in the tables of an MP4."""
    found = bytearray(data)
    for match in rng.choices(list(_BOXES.finditer(data)), k=rng.choice((1, 1, 2, 4))):
        at = match.end() + rng.choice((-8, 0, 4, 4, 8, 8, 12, 16, rng.randrange(64)))
        found[at : at + 4] = rng.choice((*_COUNTS, rng.randrange(2**32))).to_bytes(4, "big")
    return bytes(found)


def damage_npz(data: bytes, rng: random.Random) -> bytes:
    """Change type, shape or values of an array, remove or rename it, or compress what it holds."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(list(members))
    match rng.randrange(6):
        case 0:
            members[name] = re.sub(
                rb"'descr': '[^']*'", f"'descr': '{rng.choice(_DTYPES)}'".encode(), members[name]
            )
        case 1:
            members[name] = re.sub(
                rb"'shape': \([^)]*\)", f"'shape': {rng.choice(_SHAPES)}".encode(), members[name]
            )
        case 2:
            del members[name]
        case 3:
            members[rng.choice(list(members))] = members[name]
        case 4:
            members[name] = damage_bytes(members[name], rng)
        case _:
            members[name] = _other_values(members[name], rng)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", rng.choice(_COMPRESSIONS)) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return packed.getvalue()


def _other_values(member: bytes, rng: random.Random) -> bytes:
    array = np.load(io.BytesIO(member), allow_pickle=False)
    if array.size and array.dtype.kind in "fiu":
        with np.errstate(invalid="ignore", over="ignore"):
            flat = array.reshape(-1)
            flat[rng.randrange(array.size)] = np.array(rng.choice(_NUMBERS)).astype(array.dtype)
    elif array.size:
        array = np.roll(array, 1) if rng.random() < 0.5 else np.array(["", "x"] * array.size)[: array.size]
    if array.ndim and rng.random() < 0.3:
        array = rng.choice(
            (array[:-1], array[::-1], np.repeat(array, 2, axis=0), array[..., None], array.ravel())
        )
    packed = io.BytesIO()
    np.save(packed, array)
    return packed.getvalue()


def damage_database(data: bytes, rng: random.Random) -> bytes:
    """Change rows, types or the schema of a landmark database, often with the check sums made right."""
    connection = sqlite3.connect(":memory:", isolation_level=None)
    try:
        connection.deserialize(data)
        connection.set_progress_handler(lambda: 1, _LONGEST_QUERY)  # a hostile view has no end
        for _ in range(rng.choice((1, 1, 2))):
            _change_database(connection, rng)
        if rng.random() < 0.6:
            _correct_sums(connection)
        return bytes(connection.serialize())
    except (sqlite3.Error, TypeError):
        return damage_bytes(data, rng)
    finally:
        connection.close()


def _change_database(connection: sqlite3.Connection, rng: random.Random) -> None:
    table = rng.choice(_TABLES)
    if rng.random() < 0.25:
        connection.executescript(rng.choice(_HOSTILE_SQL).format(table=table))
        return
    columns = [name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")]
    column = rng.choice(columns)
    rows = connection.execute(f"SELECT rowid, {column} FROM {table}").fetchall()
    row, value = rng.choice(rows)
    if isinstance(value, bytes) and rng.random() < 0.7:
        changed = damage_bytes(value, rng) if rng.random() < 0.5 else _other_numbers(value, rng)
        connection.execute(f"UPDATE {table} SET {column} = ? WHERE rowid = ?", (changed, row))
    else:
        connection.execute(f"UPDATE {table} SET {column} = {rng.choice(_SQL_VALUES)} WHERE rowid = ?", (row,))


def _other_numbers(blob: bytes, rng: random.Random) -> bytes:
    """Replace one of the 8-byte numbers of a blob."""
    at = rng.randrange(max(len(blob) // 8, 1)) * 8
    number = rng.choice(
        (struct.pack("<d", rng.choice(_NUMBERS)), struct.pack("<q", rng.choice((-1, 0, 1, 2**40))))
    )
    return (blob[:at] + number + blob[at + 8 :])[: len(blob)]


def _correct_sums(connection: sqlite3.Connection) -> None:
    blobs = {
        "cell": "landmark, numbers, views, view_numbers",
        "template": "pixels",
        "keyframe": "world_T_camera, landmark, points, descriptors, thumbnail",
    }
    for table, columns in blobs.items():
        for row, *parts in connection.execute(f"SELECT rowid, {columns} FROM {table}").fetchall():
            connection.execute(f"UPDATE {table} SET check_sum = ? WHERE rowid = ?", (check_sum(*parts), row))
    connection.execute("UPDATE meta SET digest = ?", (digest(connection),))
