import subprocess
import sys
from pathlib import Path

import pytest

from vgps.runtime.allocator import give_back_memory

# in a process of its own: what others freed before would do for a test's memory
SCRIPT = """
from pathlib import Path
import numpy as np
from vgps.runtime.allocator import give_back_memory

def resident_pages():
    return int(Path("/proc/self/statm").read_text().split()[1])

give_back_memory()
before = resident_pages()
pieces = [np.ones(2**13) for _ in range(1000)]  # 64 KB each: of the heap
full = resident_pages()
pieces = pieces[::10]
give_back_memory()
print(full - before, resident_pages() - before)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not tell the memory held")
def test_memory_freed_between_pieces_that_stay_is_given_back():
    told = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    full, after = (int(pages) for pages in told.stdout.split())
    assert full > 10_000
    assert after < 0.4 * full


def test_it_is_no_matter_where_it_cannot_be_asked(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    give_back_memory()
