"""Lists of recordings: a text file with a recording per line."""

from pathlib import Path

from vgps.errors import RecordingError

_REMEDY = "write a recording per line: a folder or a video, relative to the list's own folder"


def is_list(recording: Path) -> bool:
    """Return whether a path is that of a list rather than that of a recording."""
    return recording.suffix.lower() == ".txt" and recording.is_file()


def read_list(file: Path) -> dict[str, Path]:
    """Return the recordings of a list by the names of their run folders.

    Empty lines and those that begin with ``#`` are skipped. A run is named after the recording's folder, or
    after a video's name without its ending.

    Raises:
        RecordingError: The list cannot be read or is empty, a recording is missing, or two have one name.
    """
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"cannot be read as text ({error})", file=file, remedy=_REMEDY) from error
    found: dict[str, Path] = {}
    place_of: dict[str, int] = {}
    for number, line in enumerate(map(str.strip, lines), start=1):
        if not line or line.startswith("#"):
            continue
        path = file.parent.absolute() / Path(line).expanduser()
        if not path.exists():
            raise RecordingError(f"no {path}", file=file, place=f"line {number}", remedy=_REMEDY)
        name = path.resolve().name if path.is_dir() else path.stem
        if name in found:
            raise RecordingError(
                f"a second recording named {name}, after that of line {place_of[name]}",
                file=file,
                place=f"line {number}",
                remedy="rename one of them: their runs would have one name",
            )
        found[name], place_of[name] = path, number
    if not found:
        raise RecordingError("the list is empty", file=file, remedy=_REMEDY)
    return found
