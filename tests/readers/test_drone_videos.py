"""A drone's video with its subtitles, in every dialect of the files in dji_srt: one command each."""

import shutil

import numpy as np
import pytest
from user_files import DIALECTS, write_drone_video

from vgps.evaluation import evaluate
from vgps.model import FixClass
from vgps.readers.recording import open_recording

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("name", [*DIALECTS, "mavic_2_style"])
def test_fixes_are_at_their_times_and_places(recording, tmp_path, name):
    opened, true = open_recording(write_drone_video(recording, tmp_path, name)), open_recording(recording).gps
    log = opened.gps
    assert log.airborne and set(log.fix_class) == {FixClass.SINGLE}
    # one dialect has dates, which count from the first subtitle
    np.testing.assert_allclose(log.t_s, true.t_s, atol=0.031 if name == "mavic_2_style" else 1e-6)
    np.testing.assert_allclose(log.latitude_deg, true.latitude_deg, atol=6e-8)
    np.testing.assert_allclose(log.longitude_deg, true.longitude_deg, atol=6e-8)
    if name in {"MAVIC3", "air2s", "m2zoom"}:
        np.testing.assert_allclose(log.height_m, true.height_m, atol=1e-3)
    elif name in {"mavic_2pro_new", "mavic_2_style"}:
        assert (log.height_m == 0.0).all()
    else:  # above the take-off: their differences are true
        np.testing.assert_allclose(np.diff(log.height_m), np.diff(true.height_m), atol=0.11)


@pytest.mark.parametrize("name", ["m2zoom", "mavic_2_style"])
def test_one_command_smooths_a_drone_s_video(brief, tmp_path, vgps_verb, name):
    # the walk is shorter than the region of the class single needs: a survey gives a smaller one
    (tmp_path / "survey.yaml").write_text("single: {r_m: 0.5, h_m: 0.5}\n")
    video = write_drone_video(brief, tmp_path, name)
    survey = tmp_path / "survey.yaml"
    code, _, err = vgps_verb("smooth", video, "--out", tmp_path / "run", "--survey", survey)
    assert code == 0, err
    truth = brief / "truth.tum"
    # the run has the first fix as origin, the truth that of the simulation
    shutil.copy(truth, tmp_path / "truth.tum")
    opened = open_recording(brief)
    (tmp_path / "rig.yaml").write_text(f"world_origin: {list(opened.rig.world_origin)}\n")
    found = evaluate(tmp_path / "run", tmp_path / "truth.tum")
    assert found.every_frame_posed and found.camera_horizontal_m.mean < 0.5
    # without heights that of the origin is 0, and the shape of the path is the video's
    height = np.asarray(found.camera_error_m)[:, 2]
    assert np.std(height) < 0.5 and (name == "mavic_2_style" or np.abs(height).mean() < 0.5)
