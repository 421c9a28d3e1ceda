"""Arrays on disk keep what is written while their memory is given back."""

from pathlib import Path

import numpy as np
import pytest

from vgps.solver import disk_arrays
from vgps.solver.disk_arrays import DiskArrays, stored


@pytest.fixture(autouse=True)
def forgetful(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give memory back at once, and reserve little."""
    monkeypatch.setattr(disk_arrays, "_RESIDENT", 0)
    monkeypatch.setattr(disk_arrays, "_SEGMENT", 4096)


def test_what_was_written_is_there_after_its_memory_was_given_back() -> None:
    arrays, rng = DiskArrays(), np.random.default_rng(0)
    written = [rng.normal(size=shape) for shape in [(3, 5), (7,), (700,), (2, 6, 40), (0, 4), (5,), (90, 90)]]
    kept = [arrays.kept(one.T) for one in written]
    for one, copy in zip(written, kept, strict=True):
        assert copy.flags.c_contiguous
        np.testing.assert_array_equal(copy, one.T)
    assert arrays.size == sum(one.nbytes for one in written)


def test_new_arrays_are_zero_and_in_fortran_order() -> None:
    arrays = DiskArrays()
    first = arrays.empty((4, 300))
    first[...] = 1.0
    second = arrays.empty((4, 300))
    assert second.flags.f_contiguous and not second.any()
    arrays.passed(first.nbytes)
    assert first.all() and not second.any()


def test_stored_items_are_passed_over_again_and_again() -> None:
    items = [np.full(size, float(size)) for size in (1, 900, 5)]
    found = stored(iter(items), lambda item, arrays: arrays.kept(item))
    assert len(found) == 3 and found[-1].tolist() == [5.0] * 5
    for _ in range(2):
        for item, expected in zip(found, items, strict=True):
            np.testing.assert_array_equal(item, expected)


def resident_files_mb() -> float:
    """Return the memory of this process that files have, MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("RssFile")) / 1024.0


@pytest.mark.skipif(
    not Path("/proc/self/status").is_file(), reason="the system does not say what is resident"
)
def test_passing_over_one_array_gives_back_the_memory_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(disk_arrays, "_RESIDENT", 2**40)
    arrays = DiskArrays()
    large = arrays.kept(np.ones(2**22))
    del arrays  # what was kept stays, and is found
    full = resident_files_mb()
    monkeypatch.setattr(disk_arrays, "_RESIDENT", 0)
    DiskArrays().kept(np.ones(2**10))
    assert resident_files_mb() < full - 24.0
    assert large.sum() == 2**22


def test_what_nobody_uses_any_more_is_forgotten() -> None:
    before = len(DiskArrays._all_maps)
    kept = DiskArrays().kept(np.ones(2**10))
    assert len(DiskArrays._all_maps) == before + 1
    del kept
    assert len(DiskArrays._all_maps) == before
