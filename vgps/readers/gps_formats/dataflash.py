"""ArduPilot's dataflash logs: messages that the log itself describes, read without a library.

pymavlink's reader may never end on a damaged log. Format: ``FMT`` messages give type, length, name, a letter
per field (``AP_Logger``'s LogStructure.h) and the fields' names.
"""

import struct
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

SYNC = b"\xa3\x95"
_FMT, _FMT_BYTES = 128, 89
# struct's letter and scale of each letter
_LETTERS = {
    **{letter: (letter, 1.0) for letter in "bBhHiIfdqQ"},
    **{"a": ("64s", 0.0), "n": ("4s", 0.0), "N": ("16s", 0.0), "Z": ("64s", 0.0), "M": ("B", 1.0)},
    **{"c": ("h", 0.01), "C": ("H", 0.01), "e": ("i", 0.01), "E": ("I", 0.01)},
    **{"L": ("i", 1e-7), "g": ("e", 1.0)},
}


def dataflash_messages(data: bytes, name: str) -> Iterator[Any]:
    """Yield the messages of a name, their fields as attributes; damaged stretches are passed over."""
    lengths, layout, wanted = {_FMT: _FMT_BYTES}, None, -1
    at = data.find(SYNC)
    while 0 <= at < len(data) - 3:
        kind = data[at + 2]
        length = lengths.get(kind, 0)
        if length < 3 or at + length > len(data) or data[at : at + 2] != SYNC:
            at = data.find(SYNC, at + 1)
            continue
        body = data[at + 3 : at + length]
        if kind == _FMT:
            number, size, label, letters, columns = struct.unpack("<BB4s16s64s", body)
            lengths[number] = size if number != _FMT else _FMT_BYTES
            if _text(label) == name:
                layout, wanted = _layout(_text(letters), _text(columns), size), number
        elif kind == wanted and layout is not None:
            yield _message(layout, body)
        at += length


def _layout(letters: str, columns: str, size: int) -> tuple[str, list[tuple[str, float]]] | None:
    """Return struct's format and the name and scale of each field; None if they do not fit."""
    names = columns.split(",")
    if len(names) != len(letters) or not set(letters) <= _LETTERS.keys():
        return None
    packed = "<" + "".join(_LETTERS[letter][0] for letter in letters)
    if struct.calcsize(packed) != size - 3:
        return None
    return packed, [(name, _LETTERS[letter][1]) for name, letter in zip(names, letters, strict=True)]


def _message(layout: tuple[str, list[tuple[str, float]]], body: bytes) -> SimpleNamespace:
    packed, fields = layout
    values = zip(fields, struct.unpack(packed, body), strict=True)
    return SimpleNamespace(**{name: value * scale if scale else value for (name, scale), value in values})


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("latin-1")
