"""A list of recordings names a run folder for each, and says in which line something is wrong."""

import pytest

from vgps.cluster.recording_list import is_list, read_list
from vgps.errors import RecordingError


@pytest.fixture
def street(tmp_path):
    for name in ("monday", "tuesday"):
        (tmp_path / name).mkdir()
    (tmp_path / "evening.mp4").write_bytes(b"")
    return tmp_path


def listed(folder, text):
    file = folder / "list.txt"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def test_runs_are_named_after_folders_and_videos_beside_the_list(street):
    file = listed(street, "\ufeff# a street\n\nmonday/\n  tuesday\r\nevening.mp4\n")
    assert is_list(file) and not is_list(street) and not is_list(street / "evening.mp4")
    names = {"monday": "monday", "tuesday": "tuesday", "evening": "evening.mp4"}
    assert read_list(file) == {run: street / path for run, path in names.items()}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("# nothing\n\n", "the list is empty"),
        ("monday\nwednesday\n", r"line 2: no .*wednesday"),
        ("monday\n\nother/../monday\n", r"line 3"),
        ("monday\n./monday\n", "line 2: a second recording named monday, after that of line 1"),
        (b"\xff\xfe\x00", "cannot be read as text"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(street, text, words):
    with pytest.raises(RecordingError, match=words):
        read_list(listed(street, text))
