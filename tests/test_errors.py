import inspect

import pytest

from vgps import errors
from vgps.errors import GpsLogError, VgpsError


def test_a_message_names_file_place_found_expected_and_remedy_in_one_line() -> None:
    error = GpsLogError(
        "height\n is 'x'", file="a/gps.csv", place="line 3", expected="a number", remedy="write it in metres"
    )
    assert str(error) == "a/gps.csv, line 3: height is 'x'; expected a number; write it in metres"
    assert (error.file, error.place, error.expected) == ("a/gps.csv", "line 3", "a number")


@pytest.mark.parametrize(
    ("more", "text"), [({}, "found"), ({"file": "f"}, "f: found"), ({"expected": "e"}, "found; expected e")]
)
def test_parts_may_be_missing(more, text) -> None:
    assert str(VgpsError("found", **more)) == text


def test_every_error_is_caught_as_one() -> None:
    classes = [
        one for _, one in inspect.getmembers(errors, inspect.isclass) if one.__module__ == errors.__name__
    ]
    assert len(classes) > 8 and all(issubclass(one, VgpsError) for one in classes)


def test_what_a_file_says_cannot_flood_or_control_the_terminal() -> None:
    line = str(VgpsError("a" * 10_000, file="f\x1b[31m", place="line\n1", expected="\x07"))
    assert line == rf"f\x1b[31m, line 1: {'a' * 240}...; expected \x07"
