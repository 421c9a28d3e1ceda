"""The state of long work as one file: plain data and arrays, and nothing that could be executed.

Objects are stored by the name of their class with their attributes, and made again only of classes that the
reader names. An object that is referred to twice is one object again.
"""

import contextlib
import json
import zipfile
import zlib
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from vgps.errors import RunFolderError

_DAMAGE = (
    OSError,
    EOFError,
    ValueError,
    LookupError,
    TypeError,
    RecursionError,
    zipfile.BadZipFile,
    zlib.error,
)


def write_state(
    state: Mapping[str, Any], file: Path, classes: Sequence[type], without: Collection[str] = ()
) -> None:
    """Write a state; the file is replaced only when the new one is complete.

    Args:
        state: Numbers, words, lists, tuples, sets, mappings, arrays, and objects of ``classes``.
        file: The file.
        classes: Classes of the objects.
        without: Attributes that are left out: who takes the state has them.

    Raises:
        TypeError: The state has something else in it.
        OSError: The file cannot be written.
    """
    writer = _Writer(classes, without)
    tree = json.dumps(writer.encoded(dict(state)))
    scratch = file.with_name(f"{file.name}.new")
    try:
        with scratch.open("wb") as stream:
            np.savez(stream, tree=np.array(tree), data=np.frombuffer(b"".join(writer.blobs), np.uint8))
        scratch.replace(file)
    finally:
        scratch.unlink(missing_ok=True)


def write_checkpoint(
    state: Mapping[str, Any], file: Path, classes: Sequence[type], without: Collection[str] = ()
) -> None:
    """Write a state as :func:`write_state` does, and make its folder.

    Raises:
        RunFolderError: The disk cannot be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_state(state, file, classes, without)
    except OSError as error:
        with contextlib.suppress(OSError):  # an earlier checkpoint is in it
            file.parent.rmdir()
        raise RunFolderError(
            f"cannot be written ({error.strerror})", file=file, remedy="check the free space"
        ) from error


def read_state(file: Path, classes: Sequence[type]) -> dict[str, Any]:
    """Return a state that was written.

    Raises:
        RunFolderError: The file is damaged, or of a version with other classes.
    """
    try:
        with np.load(file, allow_pickle=False) as archive:
            tree, data = json.loads(str(archive["tree"])), archive["data"]
        state: dict[str, Any] = _Reader(classes, data).decoded(tree)
    except _DAMAGE as error:
        raise RunFolderError(
            f"is damaged ({error})", file=file, remedy="run again without --resume"
        ) from error
    return state


class _Writer:
    def __init__(self, classes: Sequence[type], without: Collection[str]) -> None:
        self._classes, self._without = set(classes), without
        self._numbers: dict[int, int] = {}
        self._kept: list[Any] = []  # so that no id is used twice
        self._size = 0
        self.blobs: list[bytes] = []

    def encoded(self, value: Any) -> Any:
        """Return a value as JSON has it; arrays become places in the data."""
        if value is None or type(value) in {bool, int, float, str}:
            return value
        if isinstance(value, np.ndarray):
            return self._array(value)
        if isinstance(value, np.generic):
            return self._array(np.asarray(value)) | {"scalar": True}
        if type(value) in {list, tuple, set, frozenset}:
            items = sorted(value) if isinstance(value, set | frozenset) else value
            return {"is": type(value).__name__, "items": [self.encoded(item) for item in items]}
        if type(value) is dict:
            return {"is": "dict", "items": [[self.encoded(k), self.encoded(v)] for k, v in value.items()]}
        return self._object(value)

    def _array(self, value: npt.NDArray[Any]) -> dict[str, Any]:
        blob, first = np.ascontiguousarray(value).tobytes(), self._size
        self.blobs.append(blob)
        self._size += len(blob)
        return {"is": "array", "dtype": value.dtype.str, "shape": list(value.shape), "first": first}

    def _object(self, value: Any) -> dict[str, Any]:
        if type(value) not in self._classes:
            raise TypeError(f"{type(value).__name__} cannot be stored")
        if id(value) in self._numbers:
            return {"is": "same", "number": self._numbers[id(value)]}
        self._numbers[id(value)] = len(self._kept)
        self._kept.append(value)
        kept = {name: item for name, item in vars(value).items() if name not in self._without}
        state = {name: self.encoded(item) for name, item in kept.items()}
        return {"is": "object", "class": type(value).__name__, "state": state}


class _Reader:
    def __init__(self, classes: Sequence[type], data: npt.NDArray[np.uint8]) -> None:
        self._classes = {kind.__name__: kind for kind in classes}
        self._data = data
        self._made: list[Any] = []

    def decoded(self, node: Any) -> Any:
        """Return the value of a node."""
        if not isinstance(node, dict):
            return node
        kind = node["is"]
        if kind == "array":
            return self._array(node)
        if kind == "object":
            made: Any = object.__new__(self._classes[node["class"]])
            self._made.append(made)
            vars(made).update({name: self.decoded(item) for name, item in node["state"].items()})
            return made
        if kind == "same":
            return self._made[node["number"]]
        if kind == "dict":
            return {self.decoded(key): self.decoded(value) for key, value in node["items"]}
        items = [self.decoded(item) for item in node["items"]]
        return {"list": list, "tuple": tuple, "set": set, "frozenset": frozenset}[kind](items)

    def _array(self, node: Mapping[str, Any]) -> Any:
        dtype, shape, first = np.dtype(node["dtype"]), tuple(node["shape"]), node["first"]
        size = int(np.prod(shape, dtype=np.int64)) * dtype.itemsize
        if dtype.hasobject or first < 0 or first + size > len(self._data):
            raise ValueError("an array beyond the data")
        array = np.frombuffer(self._data[first : first + size].tobytes(), dtype).reshape(shape).copy()
        return array[()] if node.get("scalar") else array
