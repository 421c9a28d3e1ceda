"""A rig's other cameras: their videos on the clock of the first, and mistakes in rig.yaml."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from clips import picture, write_clip
from PIL import Image

from vgps.errors import CalibrationError, RecordingError
from vgps.readers.recording import open_recording
from vgps.readers.rig_cameras import refuse_several

LENS = "model: pinhole\nwidth: 64\nheight: 48\nfx: 50\nfy: 50\ncx: 31.5\ncy: 23.5\n"
REAR = {"name": "rear", "video": "rear.mp4", "reference_R_camera": [[-1, 0, 0], [0, 1, 0], [0, 0, -1]]}


def folder(path: Path, *cameras: dict) -> Path:
    write_clip(path / "video.mp4", frames=6)
    write_clip(path / "rear.mp4", frames=4)
    (path / "camera.yaml").write_text(LENS)
    (path / "rig.yaml").write_text(yaml.safe_dump({"cameras": list(cameras)}))
    return path


def test_a_camera_of_the_rig_has_its_pose_its_lens_and_the_clock_of_the_first(tmp_path: Path) -> None:
    (tmp_path / "rear.yaml").write_text(LENS.replace("50", "70"))
    place = {"reference_p_camera": [0.1, 0, -0.2], "time_offset_s": 0.05, "rotation_sigma_deg": 1.0}
    recording = open_recording(folder(tmp_path, {**REAR, **place, "camera": "rear.yaml"}))
    (rear,) = recording.cameras
    assert (rear.name, rear.camera.fx, recording.camera.fx) == ("rear", 70.0, 50.0)
    np.testing.assert_allclose(rear.reference_T_camera[:3, 3], [0.1, 0.0, -0.2])
    np.testing.assert_allclose(rear.reference_T_camera[:3, :3], np.diag([-1.0, 1.0, -1.0]))
    np.testing.assert_allclose(rear.sigma, [*[np.radians(1.0)] * 3, *[0.01] * 3])
    assert rear.video.times_s[0] == pytest.approx(0.05)
    assert [frame.t_s for frame in rear.video.frames()] == pytest.approx(rear.video.times_s.tolist())
    assert getattr(rear.video, "warnings", None) == ()
    assert (rear.video.width, rear.video.height, rear.video.path.name) == (64, 48, "rear.mp4")


def test_without_a_lens_of_its_own_it_has_that_of_the_first_and_may_have_masks(tmp_path: Path) -> None:
    masks = tmp_path / "masks" / "rear"
    masks.mkdir(parents=True)
    Image.fromarray(np.zeros((48, 64), np.uint8)).save(masks / "rear.mp4.png")
    recording = open_recording(folder(tmp_path, REAR))
    assert recording.cameras[0].camera == recording.camera
    assert recording.cameras[0].masks is not None
    hidden = recording.cameras[0].masks.of_frame(0)
    assert hidden is not None and not hidden.any()
    assert open_recording(tmp_path, cameras=False).cameras == ()


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"video": "none.mp4"}, "no video none.mp4 of camera rear"),
        ({"time_offset_s": 100.0}, "is recorded from 100.00"),
        ({"name": "../rear"}, "1 to 40 letters, digits, - and _"),
        (
            {"reference_R_camera": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]},
            "key reference_R_camera of camera rear: a reflection",
        ),
        ({"reference_p_camera": 0.3}, "key cameras.0.reference_p_camera: 0.3; expected a list"),
        ({"rotation_sigma_deg": -1.0}, "greater than or equal to 0"),
        ({"vidio": "rear.mp4"}, "key cameras.0.vidio: unknown key; did you mean video?"),
        ({"roll": 1.0}, "unknown key; known keys: name, video, camera, reference_R_camera"),
    ],
)
def test_a_mistake_in_a_camera_names_the_file(tmp_path: Path, change: dict, found: str) -> None:
    with pytest.raises((CalibrationError, RecordingError), match=found) as error:
        open_recording(folder(tmp_path, {**REAR, **change}))
    assert "rig.yaml" in str(error.value)


def test_two_cameras_of_one_name_and_a_camera_of_another_size_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="2 cameras named rear"):
        open_recording(folder(tmp_path, REAR, REAR))
    (tmp_path / "rear.yaml").write_text(LENS.replace("48", "40"))
    with pytest.raises(
        CalibrationError, match=r"rear.yaml: a camera of 64 x 40; expected 64 x 48 as in .*rear.mp4"
    ):
        open_recording(folder(tmp_path, {**REAR, "camera": "rear.yaml"}))
    write_clip(tmp_path / "wide.mp4", frames=4, draw=lambda index: picture(index, width=80))
    with pytest.raises(
        CalibrationError, match="camera rear has no calibration, and pictures of 80 x 48; expected 64 x 48"
    ):
        open_recording(folder(tmp_path, {**REAR, "video": "wide.mp4"}))


def test_a_rig_needs_calibrations(tmp_path: Path) -> None:
    folder(tmp_path, REAR)
    (tmp_path / "camera.yaml").unlink()
    with pytest.raises(CalibrationError, match="beside a rig of several cameras"):
        open_recording(tmp_path)


def test_a_verb_for_one_camera_refuses_a_rig(tmp_path: Path) -> None:
    recording = open_recording(folder(tmp_path, REAR))
    with pytest.raises(
        RecordingError, match="a rig of 2 cameras; expected one camera, as vgps online takes it"
    ):
        refuse_several(recording, "vgps online")
