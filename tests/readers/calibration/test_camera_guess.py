"""What files say of their cameras: tags, EXIF, subtitles, or nothing."""

import av
import numpy as np
import pytest
from clips import picture, write_clip
from metadata_videos import write_metadata_video
from PIL import Image

from vgps.readers.calibration.camera_guess import guess_cameras
from vgps.readers.gopro.gpmf import Telemetry
from vgps.readers.video.images import ImageFolder
from vgps.readers.video.video_file import VideoFile

DIAGONAL_35_MM = 43.2666


def guesses_of(path):
    video = ImageFolder(path) if path.is_dir() else VideoFile(path)
    return guess_cameras(video, Telemetry(path))


def test_an_unknown_camera_is_a_plain_lens_or_a_fisheye(tmp_path):
    plain, wide = guesses_of(write_clip(tmp_path / "dash.mp4"))
    assert (plain.camera.model, wide.camera.model) == ("opencv", "fisheye")
    assert plain.source.startswith("nothing is known of the camera")
    assert plain.focal_sigma >= 0.4 and wide.focal_sigma >= 0.4
    assert (plain.camera.cx, plain.camera.cy) == (31.5, 23.5)


@pytest.mark.parametrize(
    ("text", "equivalent_mm"),
    [
        ("[iso: 100] [focal_len: 24.00] [dzoom_ratio: 1.00] [latitude: 48.1]", 24.0),
        ("[iso : 110] [focal_len : 280] [latitude : -35.0]", 28.0),
        ("[iso: 100] [focal_len : 240] [dzoom_ratio: 20000, delta:0] [latitude: 48.1]", 48.0),
        ("[iso : 100] [latitude : 48.1] [longitude : 11.5]", 24.0),
    ],
)
def test_a_drones_subtitles_give_the_focal_length(tmp_path, text, equivalent_mm):
    video = write_clip(tmp_path / "DJI_0001.mp4")
    (tmp_path / "DJI_0001.SRT").write_text(f"1\n00:00:00,000 --> 00:00:00,033\n{text}\n")
    found, *_ = guesses_of(video)
    # the video has the whole width of a sensor of 4:3, 64 pixels wide and 80 across
    assert found.camera.fx == pytest.approx(equivalent_mm / DIAGONAL_35_MM * 80, rel=1e-4)


def test_other_subtitles_say_nothing(tmp_path):
    video = write_clip(tmp_path / "film.mp4")
    (tmp_path / "film.srt").write_text("1\n00:00:00,000 --> 00:00:02,000\nWhere? In isolation.\n")
    assert len(guesses_of(video)) == 2


def test_a_phones_tags_give_its_focal_length(tmp_path):
    file = write_clip(tmp_path / "phone.mov", container_options={"movflags": "use_metadata_tags"})
    assert len(guesses_of(file)) == 2
    tagged = tmp_path / "tagged.mov"
    with (
        av.open(str(file)) as given,
        av.open(str(tagged), "w", options={"movflags": "use_metadata_tags"}) as made,
    ):
        made.metadata["com.apple.quicktime.make"] = "Apple"
        made.metadata["com.apple.quicktime.model"] = "iPhone 13"
        made.metadata["com.apple.quicktime.camera.focal_length.35mm_equivalent"] = "50.00mm"
        stream = made.add_stream_from_template(given.streams.video[0])
        for packet in given.demux(given.streams.video[0]):
            if packet.dts is not None:
                packet.stream = stream
                made.mux(packet)
    found, *_ = guesses_of(tagged)
    assert found.source == "Apple iPhone 13 with a lens of 50 mm in 35 mm terms by its tags"
    assert found.camera.fx == pytest.approx(50 / DIAGONAL_35_MM * 80, rel=1e-4)


def test_a_phone_s_video_with_action_in_its_title_is_a_phone_s(tmp_path):
    tags = {"com.apple.quicktime.make": "Apple", "title": "Action"}
    found, *_ = guesses_of(write_metadata_video(tmp_path / "IMG_0001.MOV", [], tags=tags))
    assert "most phones" in found.source


def test_any_lens_follows_what_a_file_states(tmp_path):
    tags = {"com.apple.quicktime.make": "Apple"}
    stated, *others = guesses_of(write_metadata_video(tmp_path / "IMG_0001.MOV", [], tags=tags))
    assert [guess.camera.model for guess in others] == ["opencv", "fisheye"]
    assert all(guess.focal_sigma >= 0.4 for guess in others)
    assert all(guess.source.startswith(f"{stated.source}, which the video contradicts") for guess in others)


def test_exif_of_pictures_gives_the_focal_length(tmp_path):
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 28
    for index in range(3):
        Image.fromarray(picture(index)).save(tmp_path / f"{index}.jpg", exif=exif)
    (tmp_path / "frame_times.csv").write_text("frame,t_s\n0,0\n1,1\n2,2\n")
    found, *_ = guesses_of(tmp_path)
    assert found.camera.fx == pytest.approx(28 / DIAGONAL_35_MM * np.hypot(64, 48), rel=1e-4)
    assert found.source == "a lens of 28 mm in 35 mm terms by its EXIF"
