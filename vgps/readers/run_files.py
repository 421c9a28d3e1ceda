"""The three files that a run is read from, refused where they are damaged or of a later version."""

import json
import lzma
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from vgps.config import Config, present_names
from vgps.config.yaml_text import YamlTextError, parse_yaml
from vgps.errors import RunFolderError
from vgps.readers.run_checks import REMEDY, Arrays, check_archive

SCHEMA_VERSION = 1  # of the files of a run folder; files without a version are of this one
# raised by zipfile and NumPy on damaged bytes; RuntimeError: a member marked as encrypted or newer
_BAD_ARCHIVE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    OSError,
    EOFError,
    TypeError,
    ValueError,
    KeyError,
    RuntimeError,
    SyntaxError,  # these two: the header of an array
    TokenError,
)


def run_folders(path: Path) -> list[Path]:
    """Return the run folders in a folder of joined runs, or the folder itself.

    Raises:
        RunFolderError: As :func:`read_summary`.
    """
    names = joined_names(read_summary(path))
    return [path] if names is None else [path / name for name in names]


def joined_names(summary: Mapping[str, Any]) -> list[str] | None:
    """Return the names of the runs that a summary of joined runs lists; None for one run."""
    names = summary.get("runs")
    return names if isinstance(names, list) and names and all(isinstance(one, str) for one in names) else None


def read_summary(path: Path) -> dict[str, Any]:
    """Read ``solution.json`` of a run folder.

    Raises:
        RunFolderError: There is no such folder or file, or it is damaged or of a later schema.
    """
    if not path.is_dir():
        raise RunFolderError("not a folder", file=path, expected="a run folder, as vgps smooth writes it")
    file = path / "solution.json"
    try:
        summary = json.loads(_bytes(file))
    except (ValueError, RecursionError) as error:
        raise RunFolderError(f"is damaged ({error})", file=file, expected="JSON", remedy=REMEDY) from error
    if not isinstance(summary, dict):
        raise RunFolderError("not a JSON object", file=file, remedy=REMEDY)
    _check_schema(summary.get("schema_version"), file)
    return summary


def _check_schema(found: Any, file: Path) -> None:
    """Refuse what a later vgps wrote differently; runs from before version 0.1.0 have no schema version."""
    if found is None:
        return
    if not isinstance(found, int) or found < 1:
        raise RunFolderError(f"{found!r}", file=file, place="key schema_version", expected="a whole number")
    if found > SCHEMA_VERSION:
        raise RunFolderError(
            f"schema version {found}",
            file=file,
            expected=f"at most {SCHEMA_VERSION}",
            remedy="update vgps: a later version wrote this run",
        )


def _bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except FileNotFoundError as error:
        raise RunFolderError(
            "is missing",
            file=file,
            expected="a run folder",
            remedy="name what vgps smooth wrote with --out, or run it again",
        ) from error
    except OSError as error:
        raise RunFolderError(f"cannot be read ({error.strerror})", file=file) from error


def read_arrays(file: Path) -> Arrays:
    """Read ``measurements.npz``.

    Raises:
        RunFolderError: There is no such file, or it is damaged or of a later schema.
    """
    if not file.is_file():
        raise RunFolderError("is missing", file=file, remedy=REMEDY)
    try:
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            check_archive(archive.zip, file.stat().st_size)
            arrays = {key: archive[key] for key in archive.files}
    except _BAD_ARCHIVE as error:
        raise RunFolderError(
            f"is damaged ({error})", file=file, expected="a NumPy archive", remedy=REMEDY
        ) from error
    _check_schema(arrays["schema_version"].tolist() if "schema_version" in arrays else None, file)
    return arrays


def read_settings(file: Path) -> dict[str, Any]:
    """Read ``config.yaml``, its settings under the names that they have now.

    Raises:
        RunFolderError: There is no such file, or it is damaged.
    """
    try:
        config = parse_yaml(_bytes(file)) or {}
    except YamlTextError as error:
        raise RunFolderError(f"is damaged ({error})", file=file, expected="YAML", remedy=REMEDY) from error
    if not isinstance(config, dict):
        raise RunFolderError("not a YAML mapping", file=file, remedy=REMEDY)
    try:
        return present_names(config, Config)[0]
    except ValueError as error:
        raise RunFolderError(f"is damaged ({error})", file=file, remedy=REMEDY) from error
