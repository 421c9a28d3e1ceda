"""Fields of a YAML file, with one line for each mistake in it."""

from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from vgps.config.yaml_text import YamlTextError, parse_yaml
from vgps.errors import CalibrationError
from vgps.model import FloatArray
from vgps.readers.table import read_bytes

Positive = Annotated[FiniteFloat, Field(gt=0)]
Readout = Annotated[FiniteFloat, Field(ge=-1.0, le=1.0)]
Pixels = Annotated[int, Field(gt=0, le=1_000_000)]
Vector3 = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Rotation = tuple[Vector3, Vector3, Vector3]
_ORTHOGONAL = 1e-3  # tolerance for the rounding of a printed rotation
_MEANT = {"tuple_type": "a list", "model_type": "keys and values"}  # by pydantic's type of mistake


class Fields(BaseModel):
    """Fields of a file, which has no others."""

    model_config = ConfigDict(extra="forbid", frozen=True)


F = TypeVar("F", bound=Fields)


def read_fields(fields: type[F], path: Path) -> F:
    """Read the fields of a file; an empty one has none.

    Raises:
        CalibrationError: The file is missing or not YAML, or a field is unknown, missing or impossible.
    """
    return validated(fields, mapping_of(path, may_be_empty=True), path)


def mapping_of(path: Path, *, may_be_empty: bool = False) -> dict[str, Any]:
    """Return a file's keys and values.

    Raises:
        CalibrationError: It is missing or not YAML, or has no keys.
    """
    try:
        content = parse_yaml(read_bytes(path, CalibrationError))
    except YamlTextError as error:
        raise CalibrationError(
            f"not YAML ({error.problem})",
            file=path,
            place=f"line {error.line}" if error.line else None,
            expected="text with lines of the form 'key: value'",
        ) from error
    if content is None and may_be_empty:
        return {}
    if not isinstance(content, dict):
        raise CalibrationError("no fields", file=path, expected="lines of the form 'key: value'")
    return {str(key): value for key, value in content.items()}


def validated(fields: type[F], content: dict[str, Any], path: Path) -> F:
    """Return the fields that a mapping from a file holds.

    Raises:
        CalibrationError: A field is unknown, missing or impossible.
    """
    try:
        return fields.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        *above, last = map(str, first["loc"])
        key = ".".join((*above, last))
        place = f"key {key}"
        if first["type"] == "missing":
            raise CalibrationError("missing", file=path, place=place, remedy=f"add {key}") from None
        if first["type"] == "extra_forbidden":
            known = list(_fields_at(fields, above).model_fields)
            close = get_close_matches(last, known, 1, 0.6)
            remedy = f"did you mean {close[0]}?" if close else f"known keys: {', '.join(known)}"
            raise CalibrationError("unknown key", file=path, place=place, remedy=remedy) from None
        expected = first["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        expected = _MEANT.get(first["type"], expected)
        raise CalibrationError(f"{first['input']!r}", file=path, place=place, expected=expected) from None


def _fields_at(fields: type[Fields], above: list[str]) -> type[Fields]:
    """Return the fields that a file has under some keys and rows of lists."""
    for name in above:
        if name in fields.model_fields:
            fields = get_args(fields.model_fields[name].annotation)[0]
    return fields


def rotation_of(rows: Rotation, path: Path, place: str) -> FloatArray:
    """Return the rotation (3, 3) nearest to a printed matrix.

    Raises:
        CalibrationError: It is no rotation.
    """
    matrix = np.array(rows)
    # entries beyond 2 are far from a rotation, and their squares may overflow
    off = float(np.abs(matrix @ matrix.T - np.eye(3)).max()) if np.abs(matrix).max() <= 2 else np.inf
    if off > _ORTHOGONAL or np.linalg.det(matrix) < 0:
        found = "a reflection" if off <= _ORTHOGONAL else f"R R^T differs from the identity by {off:.2g}"
        raise CalibrationError(found, file=path, place=place, expected="a rotation matrix")
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ vt, np.float64)
