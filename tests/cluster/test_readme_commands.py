"""The commands of the room's README; on a cluster that loses a worker the runs are those of one process."""

import json
import os
import re
import shlex
import shutil
import signal
import threading
import time
from pathlib import Path

import pytest
from run_files import bytes_of

distributed = pytest.importorskip("distributed")

README = Path(__file__).resolve().parents[2] / "vgps/cluster/README.md"
ALONE, ON_CLUSTER = re.findall(r"^(vgps smooth .*?)  +#", README.read_text(encoding="utf-8"), re.MULTILINE)
LIST = re.search(r"^printf '(.*)' > list.txt$", README.read_text(encoding="utf-8"), re.MULTILINE)


def files(run):
    found = bytes_of(run)
    del found["solution.json"]  # its seconds vary
    return found


def kill_who_writes(lock):
    """Kill the worker that writes a run, a second after it has begun."""
    while not (lock.is_file() and lock.read_text().strip()):
        time.sleep(0.01)
    time.sleep(1.0)
    os.kill(int(lock.read_text()), signal.SIGKILL)


@pytest.mark.slow
def test_the_job_of_a_lost_worker_gives_the_same_run(brief, smoothed_brief, tmp_path, vgps_verb, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def run(command):
        code, printed, error = vgps_verb(*shlex.split(command)[1:])
        assert code == 0, error
        return printed

    (tmp_path / "list.txt").write_text(LIST.group(1).replace("\\n", "\n"))
    shutil.copytree(brief, tmp_path / "monday")
    shutil.copytree(brief, tmp_path / "flights")
    (tmp_path / "flights/video.mp4").rename(tmp_path / "flights/tuesday.mp4")
    options = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        killer = threading.Thread(target=kill_who_writes, args=(tmp_path / "runs/.monday.lock",))
        killer.start()
        printed = run(ON_CLUSTER.replace("tcp://10.0.0.5:8786", cluster.scheduler_address))
        killer.join()
    assert "dashboard: http" in printed and "2 of 2:" in printed
    assert files(tmp_path / "runs/monday") == files(tmp_path / "runs/tuesday") == files(smoothed_brief)
    assert run(ALONE + " --resume").count("complete already") == 2
    states = json.loads((tmp_path / "runs/runs.json").read_text())["runs"]
    assert [(one["run"], one["state"]) for one in states] == [("monday", "done"), ("tuesday", "done")]
