"""Scale from the camera's height above the road: a simulated drive with exact truth, and a room."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from brief_videos import first_frames
from fewer_features import fewer_features
from textured_room import CONFIG, path, room_recording

import vgps
from scripts.common.scenes import half_size, shortened
from vgps.config import CameraHeightConfig
from vgps.readers.trajectory import read_trajectory
from vgps.simulate import SCENES, simulate

HEIGHT_M = SCENES["drive"].eye_m
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Return 8 s of a street, about 60 m, with GPS."""
    folder = tmp_path_factory.mktemp("height") / "drive"
    simulate(folder, half_size(shortened(SCENES["drive"], 8.0)))
    return folder


def length_m(trajectory):
    return np.linalg.norm(np.ptp(trajectory.world_T_camera[:, :3, 3], axis=0))


def test_a_drive_without_gps_has_the_metre_of_the_camera_height(drive, tmp_path, vgps_verb):
    """As a user runs it; the run folder's graph is that of stage D."""
    alone = tmp_path / "alone"
    alone.mkdir()
    for name in ("video.mp4", "camera.yaml"):
        shutil.copy(drive / name, alone)
    (alone / "height.yaml").write_text(
        f"camera_height: {{m: {HEIGHT_M}, sigma_m: 0.02}}\ntracking: {{max_features: 200}}\n"
    )
    words = ["smooth", alone, "--config", alone / "height.yaml", "--out", tmp_path / "run"]
    code, printed, error = vgps_verb(*words)
    assert code == 0, error
    said = " ".join((error + printed).split())
    assert "camera_height 1.65 m gives the scale to" in said
    assert "position and heading are arbitrary" in said
    found = json.loads((tmp_path / "run" / "solution.json").read_text())["sensors"]["camera_height"]
    ratio = length_m(read_trajectory(tmp_path / "run" / "poses.tum")) / length_m(
        read_trajectory(drive / "truth.tum")
    )
    assert abs(np.log(ratio)) < 2.0 * found["scale_sigma"] < 0.06
    assert found["stretches"] >= 4 and found["m"] == pytest.approx(HEIGHT_M, abs=1e-3)
    vgps.factor_graph(tmp_path / "run")  # it refuses a graph that is not that of the run


def test_a_height_that_the_fixes_contradict_is_the_first_warning(drive):
    config = fewer_features(200, camera_height={"m": 2.2, "sigma_m": 0.05})
    solution = vgps.smooth(first_frames(vgps.open_recording(drive), 60), config)
    assert "camera_height contradicts the fixes" in solution.warnings[0]
    assert solution.sensors.camera_height["m"] < 2.05


def test_a_room_has_no_ground_to_drive_on():
    config = CONFIG.model_copy(update={"camera_height": CameraHeightConfig(m=1.5)})
    solution = vgps.smooth(replace(room_recording(path(24)), gps=None), config)
    (why,) = [one for one in solution.warnings if "camera_height" in one]
    assert why.startswith("camera_height is left out: ") and not solution.sensors.camera_height
    assert any("scale are arbitrary" in one for one in solution.warnings)
