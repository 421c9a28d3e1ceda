"""Dataclasses with arrays in a form that ``==`` compares."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Return dictionaries for dataclasses and lists for arrays; tuples have their elements so."""
    if is_dataclass(value):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    if isinstance(value, tuple):
        return tuple(plain(one) for one in value)
    return value.tolist() if isinstance(value, np.ndarray) else value
