import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from brief_videos import first_frames
from fewer_features import fewer_features
from synthetic_bundle import ANTENNA
from synthetic_map import context, map_of, scene

import vgps
from vgps.config import Config
from vgps.gps.fixes import Fixes
from vgps.gps.sensors import Sensors
from vgps.mapping.control_observations import NO_CONTROL_OBSERVATIONS
from vgps.smoothing.scene.height_ties import HeightTies
from vgps.smoothing.scene.scene import scene_of_map
from vgps.smoothing.stage_d import lever_arm_check
from vgps.smoothing.stage_d.batch import optimise_batch

pytestmark = pytest.mark.slow


def doubts(warnings):
    return [text for text in warnings if "the lever arm has it" in text]


def drive(camera_p_antenna, fixes=None, heights=None):
    """Return the warnings of stage D for a synthetic drive with gentle turns."""
    problem, true, _, exact = scene(disturbed=0.2)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    made, sensors = replace(made, heights=heights), Sensors.fixed(camera_p_antenna)
    return optimise_batch(made, exact if fixes is None else fixes, sensors, context(Config())).warnings


def test_a_right_lever_arm_is_not_doubted():
    assert doubts(drive(ANTENNA)) == []


def test_a_known_height_is_another_vector_that_all_frames_share(monkeypatch):
    _, true, _, _ = scene()
    heights = HeightTies(
        first=np.array([10]),
        last=np.array([40]),
        ratio=np.array([1.0 / np.linalg.norm(true[40, :3, 3] - true[10, :3, 3])]),
        sigma=np.array([0.01]),
        prior_m=np.array([1.0, 0.01]),
    )
    monkeypatch.setattr(lever_arm_check, "_CONTRADICTION", 4.0)  # its turns are gentle
    (text,) = doubts(drive(ANTENNA + np.array([0.0, 0.0, 1.0]), heights=heights))
    assert re.search(r"at least 0\.\d\d m back of", text)


def test_without_fixes_there_is_nothing_to_doubt():
    assert doubts(drive(ANTENNA + np.array([0.0, 0.0, 1.0]), Fixes.empty())) == []


def test_turns_show_that_a_lever_arm_is_wrong_and_in_which_direction(data_dir: Path, kitti07_fixed) -> None:
    recording = first_frames(vgps.open_recording(data_dir / "kitti07", gps="gps_fix.nmea"), 100)
    rig = replace(recording.rig, camera_p_antenna=recording.rig.camera_p_antenna + np.array([-1.0, 0.0, 0.0]))
    settings = fewer_features(250, loops={"close": "no"})
    (text,) = doubts(vgps.smooth(replace(recording, rig=rig), settings).warnings)
    assert "m right" in text and "camera_p_antenna in rig.yaml" in text
    assert doubts(kitti07_fixed.warnings) == []


def test_an_antenna_far_from_the_camera_gets_the_prior_of_a_separate_one(monkeypatch) -> None:
    """The synthetic drive's antenna is 0.68 m from the camera; its turns are gentle."""
    problem, true, _, exact = scene(disturbed=0.2)
    made, _ = scene_of_map(map_of(problem, 0, len(true) - 1), 0, NO_CONTROL_OBSERVATIONS)
    unknown = Sensors.fixed(np.zeros(3)).with_unknown_antenna(Config().sensors)

    def found(contradiction: float) -> Sensors:
        monkeypatch.setattr(lever_arm_check, "_CONTRADICTION", contradiction)
        return optimise_batch(made, exact, unknown, context(Config())).sensors

    near, separate = found(np.inf), found(1.0)
    assert (near.antenna_sigma_m, separate.antenna_sigma_m) == (0.1, 1.0)
    assert np.linalg.norm(separate.camera_p_antenna - ANTENNA) < np.linalg.norm(
        near.camera_p_antenna - ANTENNA
    )
