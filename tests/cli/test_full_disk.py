"""A disk that fills up while a verb writes: nothing or a whole file, and one line."""

import resource
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest

pytestmark = pytest.mark.slow
LIMIT = 2000  # bytes of a file from which on writing fails, as on a full disk
VERBS = {
    "smooth": "smooth {brief} --out {out}",
    "online": "online {brief} --out {out}",
    "export": "export {run} --to colmap --out {out}",
    "pictures": "export {run} --to exif --every-s 3 --out {out}",
    "report": "report {run} --out {out}",
    "landmarks": "landmarks build {run} --out {out}",
    "inspect": "inspect {run} --save {out}.rrd",
    "simulate": "simulate --out {out} --scene demo",
}


def full():
    """Let every write beyond the first bytes of a file fail in this process."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, hard))


@contextmanager
def full_for_a_while():
    before = signal.getsignal(signal.SIGXFSZ), resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        full()
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before[1])
        signal.signal(signal.SIGXFSZ, before[0])


def check(code, error, out):
    assert code == 2, error
    said = [text for text in error.splitlines() if text.startswith("vgps: ")]
    assert len(said) == 1 and "cannot be written" in said[0] and "Traceback" not in error
    assert not out.parent.exists() or list(out.parent.iterdir()) == []


@pytest.mark.parametrize("verb", VERBS)
def test_a_full_disk_leaves_nothing_half_written(smoothed, brief, tmp_path, vgps_verb, monkeypatch, verb):
    out = tmp_path / "out" / "made"
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # compiled modules would be cut off, too
    with full_for_a_while():
        code, _, error = vgps_verb(*VERBS[verb].format(brief=brief, run=smoothed, out=out).split())
    check(code, error, out)


def test_a_process_on_a_full_disk_leaves_nothing_half_written(smoothed, tmp_path):
    out = tmp_path / "out" / "made"
    words = [sys.executable, "-B", "-m", "vgps", *VERBS["export"].format(run=smoothed, out=out).split()]
    done = subprocess.run(words, capture_output=True, text=True, check=False, preexec_fn=full)
    check(done.returncode, done.stderr, out)
