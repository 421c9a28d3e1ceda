"""Recordings whose picture is wider than a plane, as they are opened."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from clips import picture, write_clip
from metadata_videos import box, with_box
from PIL import Image

from vgps.errors import CalibrationError, RecordingError, VideoError
from vgps.readers.posed_video import open_posed_video
from vgps.readers.recording import open_recording
from vgps.readers.rig_cameras import refuse_several
from vgps.readers.views.view import ViewVideo

SPHERE = "model: equirectangular\nwidth: 128\nheight: 64\n"
FISHEYE = (
    "model: fisheye\nwidth: 64\nheight: 64\nfx: 18\nfy: 18\ncx: 31.5\ncy: 31.5\ndistortion: [0, 0, 0, 0]\n"
)
REAR = [[-1, 0, 0], [0, 1, 0], [0, 0, -1]]


def clip(path: Path, width: int, height: int) -> Path:
    return write_clip(path, frames=3, draw=lambda index: picture(index, width, height))


SAMPLE = (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stsd")
EQUI = box(b"sv3d", box(b"proj", box(b"equi", bytes(20))))
RDF = b"<GSpherical:ProjectionType>equirectangular</GSpherical:ProjectionType>"
MARKS = {"box": (SAMPLE, bytes(16) + EQUI), "RDF": ((b"moov", b"trak", b"uuid"), b"\xff\xcc" + RDF)}


@pytest.mark.parametrize("kind", ["box", "RDF", "camera.yaml"])
def test_the_whole_sphere_becomes_four_views_with_one_centre_and_a_note_says_so(tmp_path, kind):
    file = clip(tmp_path / "360.mp4", 128, 64)
    if kind == "camera.yaml":
        (tmp_path / "camera.yaml").write_text(SPHERE)
    else:
        names, content = MARKS[kind]
        with_box(file, *names, content=content)
    recording = open_recording(file)
    assert isinstance(recording.video, ViewVideo) and recording.guesses == ()
    assert recording.camera.model == "pinhole" and recording.camera.readout_s == 0.0
    assert [camera.name for camera in recording.cameras] == ["right", "rear", "left"]
    for camera in recording.cameras:
        assert not camera.reference_T_camera[:3, 3].any() and not camera.sigma.any()
        assert next(camera.video.frames()).gray.shape == (camera.camera.height, camera.camera.width)
    np.testing.assert_array_equal(recording.cameras[0].reference_T_camera[:3, 2], [1, 0, 0])
    np.testing.assert_array_equal(recording.cameras[1].reference_T_camera[:3, :3], REAR)
    (note,) = recording.notes
    assert "360.mp4: an equirectangular picture of the whole sphere, seen through 4 views" in note


def test_photo_sphere_xmp_marks_a_folder_of_images(tmp_path):
    for index in range(2):
        file = tmp_path / "images" / f"{index}.jpg"
        file.parent.mkdir(exist_ok=True)
        xmp = b'<x GPano:ProjectionType="equirectangular"/>'
        Image.fromarray(picture(index, 128, 64)).save(file, xmp=xmp)
    (tmp_path / "images" / "frame_times.csv").write_text("frame,t_s\n0,0.0\n1,0.5\n")
    assert len(open_recording(tmp_path / "images").cameras) == 3


@pytest.mark.parametrize(
    "content",
    [box(b"st3d", bytes(4) + b"\1") + EQUI, box(b"sv3d", box(b"proj", box(b"cbmp", bytes(12))))],
)
def test_stereo_and_other_projections_are_refused(tmp_path, content):
    file = with_box(clip(tmp_path / "360.mp4", 128, 64), *SAMPLE, content=bytes(16) + content)
    with pytest.raises(VideoError, match=r"the whole sphere; expected that of one lens.*equirectangular"):
        open_recording(file)


def test_a_flat_stereo_box_is_one_picture(tmp_path):
    content = bytes(16) + box(b"st3d", bytes(5)) + EQUI
    assert open_recording(with_box(clip(tmp_path / "a.mp4", 128, 64), *SAMPLE, content=content)).cameras


def test_a_part_of_the_sphere_is_refused(tmp_path):
    file = with_box(clip(tmp_path / "180.mp4", 64, 64), *SAMPLE, content=bytes(16) + EQUI)
    with pytest.raises(VideoError, match="equirectangular picture of 64 x 64; expected one twice as wide"):
        open_recording(file)


def test_a_sphere_of_another_size_than_the_video_is_refused(tmp_path):
    clip(tmp_path / "video.mp4", 128, 64)
    (tmp_path / "camera.yaml").write_text(SPHERE.replace("128", "256"))
    with pytest.raises(CalibrationError, match="a picture of 256 x 64; expected 128 x 64"):
        open_recording(tmp_path)


def test_a_fisheye_of_more_than_180_degrees_becomes_views_unless_one_is_asked_for(tmp_path):
    clip(tmp_path / "video.mp4", 64, 64)
    (tmp_path / "camera.yaml").write_text(FISHEYE)
    recording = open_recording(tmp_path)
    assert [camera.name for camera in recording.cameras] == ["right", "left", "up", "down"]
    assert recording.masks is None and all(camera.masks is not None for camera in recording.cameras)
    front = open_recording(tmp_path, cameras=False)
    assert front.cameras == () and front.camera == recording.camera
    plain = open_recording(tmp_path, views=False)
    assert plain.camera.model == "fisheye" and plain.cameras == () and plain.notes == ()


def test_a_rolling_shutter_of_a_wide_fisheye_is_said_to_be_left_out(tmp_path):
    clip(tmp_path / "video.mp4", 64, 64)
    (tmp_path / "camera.yaml").write_text(FISHEYE + "readout_s: 0.02\n")
    recording = open_recording(tmp_path)
    assert recording.camera.readout_s == 0.0
    assert recording.notes[-1].endswith("its rolling shutter is not modelled")


def test_both_lenses_of_a_360_degree_camera_become_views_on_one_rig(tmp_path):
    clip(tmp_path / "video.mp4", 64, 64)
    clip(tmp_path / "rear.mp4", 64, 64)
    (tmp_path / "camera.yaml").write_text(FISHEYE)
    rear = {
        "name": "rear",
        "video": "rear.mp4",
        "reference_R_camera": REAR,
        "reference_p_camera": [0, 0, -0.03],
        "time_offset_s": 0.01,
    }
    (tmp_path / "rig.yaml").write_text(yaml.safe_dump({"cameras": [rear]}))
    recording = open_recording(tmp_path)
    views = {camera.name: camera for camera in recording.cameras}
    assert list(views)[:4] == ["right", "left", "up", "down"]
    assert list(views)[4:] == [f"rear_{name}" for name in ("front", "right", "left", "up", "down")]
    # what is to the right of the lens behind is to the left of the one ahead
    right = views["rear_right"]
    np.testing.assert_allclose(right.reference_T_camera[:3, 2], [-1, 0, 0])
    np.testing.assert_allclose(right.reference_T_camera[:3, 3], [0, 0, -0.03])
    assert (right.sigma > 0).all()
    frame = next(right.video.frames())
    assert frame.t_s == 0.01 and frame.gray.shape == (right.camera.height, right.camera.width)


def test_masks_are_those_of_the_wide_picture(tmp_path):
    clip(tmp_path / "video.mp4", 128, 64)
    (tmp_path / "camera.yaml").write_text(SPHERE)
    (tmp_path / "masks").mkdir()
    mask = np.full((64, 128), 255, np.uint8)
    mask[:, 80:112] = 0  # of the right
    Image.fromarray(mask).save(tmp_path / "masks" / "video.mp4.png")
    recording = open_recording(tmp_path)
    assert recording.masks is not None
    shown = recording.masks.of_frame(0)
    assert shown is not None and shown[:, :-4].all()
    right = recording.cameras[0].masks
    assert right is not None and not right.of_frame(0)[:, 3:-3].any()


def test_control_points_are_refused(tmp_path):
    clip(tmp_path / "video.mp4", 128, 64)
    (tmp_path / "camera.yaml").write_text(SPHERE)
    (tmp_path / "control_points.csv").write_text(
        "name,frame,u_px,v_px,latitude_deg,longitude_deg,height_m,sigma_m\na,0,5,5,35,135,0,0.01\n"
    )
    with pytest.raises(RecordingError, match="control points in a picture that is seen through several"):
        open_recording(tmp_path)


def test_live_and_tracking_refuse_it(tmp_path):
    clip(tmp_path / "video.mp4", 128, 64)
    (tmp_path / "camera.yaml").write_text(SPHERE)
    with pytest.raises(RecordingError, match="seen through 4 views; expected one view, as vgps online"):
        refuse_several(open_recording(tmp_path), "vgps online")


def test_the_pictures_of_a_run_are_those_of_the_view_along_the_axis(tmp_path):
    clip(tmp_path / "video.mp4", 128, 64)
    (tmp_path / "camera.yaml").write_text(SPHERE)
    camera = open_recording(tmp_path).camera
    ((_, colours),) = open_posed_video(tmp_path, camera).pictures([1])
    assert colours.shape == (camera.height, camera.width, 3)
    (tmp_path / "camera.yaml").unlink()
    video = open_posed_video(tmp_path, camera)
    assert (video.width, video.height) == (128, 64)
