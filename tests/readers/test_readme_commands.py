"""The commands of this room's README, as it has them: each smooths what a user has."""

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from brief_videos import thinned
from fewer_features import fewer_features
from gopro_runs import check_length, check_rotations
from user_files import write_bag, write_drone_video, write_flight, write_pictures

from vgps.cluster import job
from vgps.evaluation import evaluate
from vgps.pipeline.offline import smooth
from vgps.readers.run_folder import read_run
from vgps.solution import FrameState

README = Path(__file__).resolve().parents[2] / "vgps/readers/README.md"
RECORDINGS = README.read_text(encoding="utf-8").split("## Control")[0]
COMMANDS = re.findall(r"^\| .* \| `(vgps smooth [^`]+)`", RECORDINGS, re.MULTILINE)


def gopro(folder, brief, data_dir):
    shutil.copy(data_dir / "gopro_walk/video.mp4", folder / "GX010042.MP4")


# what makes the files of a command, and the largest mean error of the run [m]: fixes of the class single are
# at the truth too, but count as metres; None without a truth
MAKERS = {
    "GX010042.MP4": (gopro, None),
    "DJI_0001.MP4": (lambda folder, brief, _: write_drone_video(brief, folder, "MAVIC3"), 3.0),
    "pictures": (lambda folder, brief, _: write_pictures(brief, folder / "pictures"), 3.0),
    "drive.bag": (lambda folder, brief, _: write_bag(brief, folder / "drive.bag"), 0.2),
    "rosbag2_2026_05_01": (
        lambda folder, brief, _: write_bag(brief, folder / "rosbag2_2026_05_01"),
        0.2,
    ),
    "drive.mcap": (lambda folder, brief, _: write_bag(brief, folder / "drive.mcap"), 0.2),
    "walk.mp4": (
        lambda folder, brief, _: write_flight(brief, folder / "walk.mp4", folder / "flight.ulg"),
        0.2,
    ),
}


def test_every_command_has_its_files():
    assert {command.split()[2] for command in COMMANDS} == set(MAKERS) and len(COMMANDS) == len(MAKERS)


@pytest.fixture
def fewer_frames(monkeypatch):
    """Return a function that lets a command smooth one of so many frames once, with fewer features."""
    settings = fewer_features(150, camera_calibration={"max_pairs": 12, "restart_share": 0.2})

    def set_every(count):
        monkeypatch.setattr(
            job, "smooth", lambda opened, _, *given: smooth(thinned(opened, count), settings, *given)
        )

    return set_every


def check_walk(run, video):
    """Every frame is in one map, and the video alone agrees with its metadata."""
    assert len(run.t_s) == 35 and np.isfinite(run.world_T_camera).all()
    assert run.state.count(FrameState.TRACKED) == 35
    # its own GPS is good to metres, but its displacements over the path of 13 m are known better
    assert run.fixes.used[run.fix_times_s <= run.t_s[-1]].all()
    assert run.camera.model == "fisheye"
    check_length(run, video)
    check_rotations(run, video)


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_one_command_smooths(command, brief, tmp_path, vgps_verb, monkeypatch, fewer_frames, request):
    name = command.split()[2]
    made, largest_m = MAKERS[name]
    real = largest_m is None
    made(tmp_path, brief, request.getfixturevalue("data_dir") if real else None)
    fewer_frames(9 if real else 2)
    monkeypatch.chdir(tmp_path)
    code, _, err = vgps_verb(*shlex.split(command)[1:])
    assert code == 0, err
    run = read_run(tmp_path / "run")
    assert run.georeferenced
    if name == "GX010042.MP4":
        check_walk(run, tmp_path / name)
    if largest_m is not None:
        if "world_origin" not in (tmp_path / "rig.yaml").read_text():
            # the origin of a drone's run is its first fix, that of the truth the simulation's
            shutil.copy(brief / "rig.yaml", tmp_path)
        shutil.copy(brief / "truth.tum", tmp_path)
        found = evaluate(tmp_path / "run", tmp_path / "truth.tum")
        assert found.frames_matched == 23 and found.camera_position_m.mean < largest_m
