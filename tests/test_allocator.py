import sys
from pathlib import Path

import numpy as np
import pytest

from vgps.allocator import give_back_memory


def resident_pages():
    return int(Path("/proc/self/statm").read_text().split()[1])


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not tell the memory held")
def test_memory_freed_between_pieces_that_stay_is_given_back():
    before = resident_pages()
    pieces = [np.ones(2**13) for _ in range(1000)]  # 64 KB each: of the heap
    full = resident_pages()
    pieces = pieces[::10]
    give_back_memory()
    assert full - before > 10_000
    assert resident_pages() - before < 0.4 * (full - before), len(pieces)


def test_it_is_no_matter_where_it_cannot_be_asked(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    give_back_memory()
