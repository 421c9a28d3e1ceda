import numpy as np
import pytest

from vgps.errors import RunFolderError
from vgps.runtime import journal as module
from vgps.runtime.journal import Journal

START = (np.arange(3.0),)


def never():
    raise AssertionError("computed again")


@pytest.fixture
def every_step_is_long(monkeypatch):
    monkeypatch.setattr(module, "_WORTH_S", 0.0)


def write_two(folder):
    journal = Journal(folder, "run", resume=False)
    journal.step(START, lambda: {"x": np.eye(2)}, ())
    journal.step(START, lambda: {"x": np.ones(4)}, ())


@pytest.mark.usefixtures("every_step_is_long")
def test_steps_are_taken_from_their_files(tmp_path):
    write_two(tmp_path / "steps")
    again = Journal(tmp_path / "steps", "run", resume=True)
    np.testing.assert_array_equal(again.step(START, never, ())["x"], np.eye(2))
    np.testing.assert_array_equal(again.step(START, never, ())["x"], np.ones(4))
    assert again.step(START, lambda: 7, ()) == 7


@pytest.mark.usefixtures("every_step_is_long")
@pytest.mark.parametrize(
    ("run", "start", "resume"), [("other", START, True), ("run", (np.zeros(3),), True), ("run", START, False)]
)
def test_other_steps_are_replaced(tmp_path, run, start, resume):
    write_two(tmp_path)
    assert Journal(tmp_path, run, resume=resume).step(start, lambda: 7, ()) == 7
    assert Journal(tmp_path, run, resume=True).step(start, never, ()) == 7


def test_a_quick_step_leaves_no_file_and_keeps_its_number(tmp_path, monkeypatch):
    journal = Journal(tmp_path / "steps", "run", resume=False)
    journal.step(START, lambda: 1, ())
    assert not (tmp_path / "steps").exists()
    monkeypatch.setattr(module, "_WORTH_S", 0.0)
    journal.step(START, lambda: 2, ())
    again = Journal(tmp_path / "steps", "run", resume=True)
    assert again.step(START, lambda: 3, ()) == 3
    assert again.step(START, never, ()) == 2


@pytest.mark.usefixtures("every_step_is_long")
def test_a_damaged_file_is_refused(tmp_path):
    write_two(tmp_path)
    (tmp_path / "step_1.npz").write_bytes(b"PK")
    with pytest.raises(RunFolderError, match="damaged"):
        Journal(tmp_path, "run", resume=True).step(START, never, ())
