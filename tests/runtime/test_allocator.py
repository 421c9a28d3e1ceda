import subprocess
import sys
from pathlib import Path

import pytest

from vgps.runtime.allocator import release_free_memory

# in a process of its own, since memory freed by earlier tests would be reused
SCRIPT = """
from pathlib import Path
import numpy as np
from vgps.runtime.allocator import release_free_memory

def resident_pages():
    return int(Path("/proc/self/statm").read_text().split()[1])

release_free_memory()
before = resident_pages()
pieces = [np.ones(2**13) for _ in range(1000)]  # 64 KB each: of the heap
full = resident_pages()
pieces = pieces[::10]
release_free_memory()
print(full - before, resident_pages() - before)
"""


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="no /proc to read the memory from")
def test_memory_freed_between_kept_pieces_is_returned():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    full, after = (int(pages) for pages in done.stdout.split())
    assert full > 10_000
    assert after < 0.4 * full


def test_a_system_without_glibc_raises_nothing(monkeypatch):
    monkeypatch.setattr(sys, "platform", "win32")
    release_free_memory()
