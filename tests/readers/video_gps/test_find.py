import re

import numpy as np
import pytest
from metadata_videos import subtitle_packet, write_metadata_video

from vgps.errors import GpsLogError
from vgps.readers.gps import read_gps_log
from vgps.readers.recording import open_recording
from vgps.readers.video.mp4_boxes import track_kinds

TEXT = "F/2.8, SS 206.54, ISO 100, EV 0, GPS (8.2500, {}, 15), D 60.85m, H {}m, H.S 5.59m/s"


@pytest.fixture
def drone(tmp_path):
    packets = [
        (0.0, subtitle_packet(TEXT.format(47.5, 20.0))),
        (0.5, subtitle_packet(TEXT.format(47.6, 21.0))),
    ]
    return write_metadata_video(tmp_path / "DJI_0001.MP4", packets)


def test_kinds_of_tracks_by_their_numbers(drone):
    assert track_kinds(drone) == {1: "avc1", 2: "tx3g"}


def test_subtitles_in_a_video_are_read_as_those_beside_it(drone):
    opened = open_recording(drone)
    assert opened.gps is not None
    np.testing.assert_allclose(opened.gps.t_s, [0.0, 0.5])
    np.testing.assert_allclose(opened.gps.latitude_deg, [47.5, 47.6])
    assert "DJI drones" in opened.guesses[0].source
    np.testing.assert_array_equal(read_gps_log(drone).latitude_deg, opened.gps.latitude_deg)


def test_the_subtitles_of_a_zoom_lens_count_more_than_the_maker(tmp_path):
    text = "[iso : 100] [focal_len : 480] [dzoom_ratio: 1..0] [latitude: 47.5] [longitude: 8.25]"
    file = write_metadata_video(
        tmp_path / "DJI_0001.MP4", [(0.0, subtitle_packet(text))], tags={"encoder": "DJI Mavic2"}
    )
    guess, *_ = open_recording(file).guesses
    assert "48 mm by its subtitles" in guess.source and guess.focal_sigma == 0.1


def test_captions_of_another_kind_are_no_fixes(tmp_path):
    file = write_metadata_video(tmp_path / "film.mp4", [(0.0, subtitle_packet("Hello"))])
    assert open_recording(file).gps is None
    with pytest.raises(GpsLogError, match=r"film\.mp4: a video without GPS, with .*\(tx3g\); exp.*--gps"):
        read_gps_log(file)


def test_what_a_phone_s_video_has_instead_of_fixes_is_named(tmp_path, caplog):
    tags = {"com.apple.quicktime.location.ISO6709": "+47.5000+008.2500+500.000/"}
    file = write_metadata_video(tmp_path / "IMG_0001.mp4", [(0.0, b"\0" * 8)], "mebx", tags)
    has = "one place for the whole video and metadata without positions that can be read (mebx)"
    assert open_recording(file).gps is None
    assert f"{file}: has {has}; continuing without GPS" in caplog.text
    with pytest.raises(GpsLogError, match=re.escape(f"a video without GPS, with {has}; expected")):
        read_gps_log(file)
