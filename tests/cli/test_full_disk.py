"""A disk that fills up while a verb writes: nothing or a whole file, and one line."""

import resource
import signal
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow
LIMIT = 2000  # bytes of a file from which on writing fails, as on a full disk
VERBS = {
    "smooth": "smooth {walk} --out {out}",
    "online": "online {walk} --out {out}",
    "export": "export {run} --to colmap --out {out}",
    "pictures": "export {run} --to exif --every-s 3 --out {out}",
    "report": "report {run} --out {out}",
    "landmarks": "landmarks build {run} --out {out}",
    "inspect": "inspect {run} --save {out}.rrd",
    "simulate": "simulate --out {out} --scene demo",
}


def full():
    """Let every write beyond the first bytes of a file fail, in the child."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))


@pytest.mark.parametrize("verb", VERBS)
def test_a_full_disk_leaves_nothing_half_written(smoothed, recording, tmp_path, verb):
    out = tmp_path / "out" / "made"
    line = VERBS[verb].format(walk=recording, run=smoothed, out=out)
    words = [sys.executable, "-B", "-m", "vgps", *line.split()]  # compiled modules would be cut off, too
    done = subprocess.run(words, capture_output=True, text=True, check=False, preexec_fn=full)
    assert done.returncode == 2, done.stderr
    said = [text for text in done.stderr.splitlines() if text.startswith("vgps: ")]
    assert len(said) == 1 and "cannot be written" in said[0] and "Traceback" not in done.stderr
    assert not out.parent.exists() or list(out.parent.iterdir()) == []
