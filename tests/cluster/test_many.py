"""Each recording of a list ends by itself, and runs.json says how."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from claims import HOLDER

from vgps.cluster import many
from vgps.cluster.job import JobReport, SmoothJob
from vgps.cluster.many import RUNS_FILE, smooth_all, smooth_list
from vgps.config import Config
from vgps.errors import RunFolderError
from vgps.pipeline.checkpoint import checkpoint_folder
from vgps.readers.control_points import PointSystem


@pytest.fixture
def jobs(tmp_path):
    def job(name):
        return SmoothJob(recording=tmp_path / name, out=tmp_path / "runs" / name, config=Config())

    return [job("monday"), job("tuesday"), job("wednesday")]


@pytest.fixture
def worked(monkeypatch):
    """The jobs that were worked on; tuesday's recording is refused."""
    done = []

    def work(job, progress=None):
        done.append(job)
        report = JobReport(recording=job.recording, out=job.out)
        bad = job.out.name == "tuesday"
        return (
            replace(report, error="no video") if bad else replace(report, digest=f"digest of {job.out.name}")
        )

    monkeypatch.setattr(many, "reported", work)
    return done


def runs_of(out):
    return {run["run"]: run for run in json.loads((out / RUNS_FILE).read_text())["runs"]}


def test_a_refused_recording_does_not_end_the_others(jobs, worked, tmp_path):
    out, states = tmp_path / "runs", []
    for _ in smooth_list(jobs, out):
        states.append([run["state"] for run in runs_of(out).values()])
    assert states == [
        ["done", "waiting", "waiting"],
        ["done", "failed", "waiting"],
        ["done", "failed", "done"],
    ]
    assert runs_of(out)["tuesday"]["error"] == "no video"
    assert runs_of(out)["monday"]["digest"] == "digest of monday"


def test_a_resumed_list_knows_the_complete_runs(jobs, worked, tmp_path):
    list(smooth_list(jobs, tmp_path / "runs"))
    worked.clear()
    again = smooth_list([replace(job, resume=True) for job in jobs], tmp_path / "runs")
    next(again)
    again.close()  # interrupted: what was complete still is
    assert [run["state"] for run in runs_of(tmp_path / "runs").values()] == ["done", "waiting", "done"]
    assert [job.finished for job in worked] == ["digest of monday"]
    worked.clear()
    list(smooth_list(jobs, tmp_path / "runs"))
    assert [job.finished for job in worked] == [None, None, None]


def test_workers_with_another_working_directory_find_every_file(tmp_path, monkeypatch):
    given = []
    monkeypatch.setattr(many, "run_on_cluster", lambda jobs, *_: iter(given.extend(jobs) or ()))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "monday").mkdir()
    for name in ("log.nmea", "grid.gtx", "rig.yaml", "monday/rig.yaml"):
        (tmp_path / name).touch()
    files = {"gps": "log.nmea", "rig": "rig.yaml", "imu": None}
    geoids = ("grid.gtx", "egm96", None)
    jobs = [
        SmoothJob(
            recording=Path("monday"),
            out=Path("run"),
            config=Config(),
            files={**files, "control_system": PointSystem("EPSG:25832", geoid)},
        )
        for geoid in geoids
    ]
    list(smooth_all(jobs, "tcp://there"))
    there = {"gps": tmp_path / "log.nmea", "rig": "rig.yaml", "imu": None}  # the recording's own rig is found
    for job, geoid in zip(given, (str(tmp_path / "grid.gtx"), "egm96", None), strict=True):
        assert (job.recording, job.out) == (tmp_path / "monday", tmp_path / "run") and job.resume
        assert job.files == {**there, "control_system": PointSystem("EPSG:25832", geoid)}


def test_an_old_checkpoint_is_forgotten_but_not_that_of_a_process_at_work(jobs, tmp_path, monkeypatch):
    monkeypatch.setattr(many, "run_on_cluster", lambda *_: iter(()))
    left = [checkpoint_folder(job.out) for job in jobs]
    for folder in left:
        folder.mkdir(parents=True)
    words = [sys.executable, "-c", HOLDER, str(jobs[1].out)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        list(smooth_all([replace(jobs[0], resume=True), *jobs[1:]], "tcp://there"))
        process.kill()
    assert [folder.is_dir() for folder in left] == [True, True, False]


def test_a_run_folder_is_no_folder_of_runs(jobs, worked, tmp_path):
    (tmp_path / "solution.json").write_text("{}")
    with pytest.raises(RunFolderError, match="is a run folder"):
        list(smooth_list(jobs, tmp_path))
    assert not worked
