"""Run folders compared: Solutions down to their leaves, tables, bytes of files."""

import csv
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np


def assert_same(found: Any, expected: Any, where: str = "solution") -> None:
    """Equal types, arrays (with dtype), NaN equal to NaN, down to the leaves."""
    if dataclasses.is_dataclass(expected):
        for item in dataclasses.fields(expected):
            assert_same(getattr(found, item.name), getattr(expected, item.name), f"{where}.{item.name}")
    elif isinstance(expected, np.ndarray):
        assert found.dtype == expected.dtype, where
        np.testing.assert_array_equal(found, expected, err_msg=where)
    elif isinstance(expected, dict):
        assert list(found) == list(expected), where
        for key in expected:
            assert_same(found[key], expected[key], f"{where}[{key}]")
    else:
        assert type(found) is type(expected), where
        assert repr(found) == repr(expected), where  # repr, since NaN is not equal to NaN


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}
