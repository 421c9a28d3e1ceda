"""The examples run as they stand."""

import sys

import pytest

from vgps.landmarks.build import build_database
from vgps.landmarks.database_writer import write_database
from vgps.readers.recording import open_recording
from vgps.readers.run_folder import read_run

pytestmark = pytest.mark.slow


@pytest.fixture
def run_example(monkeypatch, capsys):
    def run(main, *words):
        monkeypatch.setattr(sys, "argv", ["example", *map(str, words)])
        main()
        return capsys.readouterr().out

    return run


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("examples")


def test_smooth_and_query(run_example, brief, folder):
    from scripts.examples import query_landmarks, smooth_recording

    out = run_example(smooth_recording.main, brief, folder / "run", "--seed", 1)
    run = read_run(folder / "run")
    assert out.endswith(f"of {len(run.fixes.reason)} fixes lie outside their regions\n")
    assert run.config["seed"] == 1 and run.config["tracking"]["max_features"] == 500
    write_database(build_database(run, open_recording(brief)), folder / "street.vgps")
    lines = run_example(query_landmarks.main, folder / "street.vgps", folder / "run").splitlines()
    distances = [float(line.split()[2]) for line in lines[1:]]
    assert lines[0].endswith("landmarks in view") and len(distances) == 5 == len(set(lines[1:]))
    assert distances == sorted(distances)


def test_poses_come_frame_by_frame(run_example, brief, folder):
    from scripts.examples import pose_frames_live

    out = run_example(pose_frames_live.main, brief, folder / "live")
    frames = len(open_recording(brief).video.times_s)
    assert len(out.splitlines()) == frames == len(read_run(folder / "live").t_s)
    assert "tracked" in out.splitlines()[-1]
