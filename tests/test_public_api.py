"""What `import vgps` offers, and that the names are what they say."""

import inspect

import vgps
from vgps import errors


def test_everything_public_is_there_and_documented():
    for name in set(vgps.__all__) - {"__version__"}:
        assert inspect.getdoc(getattr(vgps, name)), name


def test_verbs_are_functions_and_not_rooms_of_their_name():
    for name in (
        "evaluate",
        "factor_graph",
        "localize",
        "open_recording",
        "read_camera",
        "smooth",
        "write_run",
    ):
        assert inspect.isfunction(getattr(vgps, name)), name


def test_every_mistake_of_a_user_is_a_vgps_error():
    found = [
        error
        for _, error in inspect.getmembers(errors, inspect.isclass)
        if error.__module__ == errors.__name__
    ]
    assert len(found) > 5 and all(issubclass(error, vgps.VgpsError) for error in found)
