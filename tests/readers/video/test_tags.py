import pytest
from metadata_videos import write_metadata_video

from vgps.errors import GpsLogError
from vgps.readers.recording import open_recording
from vgps.readers.video.tags import stated_time, video_tags

PHONE = {
    "com.apple.quicktime.make": "Apple",
    "com.apple.quicktime.creationdate": "2024-05-31T14:43:55+0200",
    "creation_time": "2024-05-31T12:43:56.000000Z",
}
GPX = """<gpx version="1.1" creator="watch" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="49" lon="8"><ele>100</ele><time>2024-05-31T12:43:55Z</time></trkpt></trkseg></trk></gpx>"""


def test_the_time_with_a_zone_is_preferred(tmp_path):
    file = write_metadata_video(tmp_path / "IMG_0001.MOV", [], tags=PHONE)
    assert video_tags(file)["make"] == "Apple"
    assert stated_time(file) == "2024-05-31T14:43:55+0200"


def test_a_time_that_is_none_is_not_stated(tmp_path):
    file = write_metadata_video(tmp_path / "IMG_0001.MOV", [], tags={"creationdate": "last summer"})
    assert stated_time(file) is None


def test_tags_of_what_is_no_video(tmp_path):
    (tmp_path / "v.mp4").write_bytes(b"no video")
    assert video_tags(tmp_path / "v.mp4") == {} and stated_time(tmp_path / "missing.mp4") is None


def test_a_log_in_utc_is_refused_with_the_time_that_the_video_states(tmp_path):
    file = write_metadata_video(tmp_path / "IMG_0001.MOV", [], tags=PHONE)
    (tmp_path / "gps.gpx").write_text(GPX)
    with pytest.raises(GpsLogError, match=r"; IMG_0001\.MOV says 2024-05-31T14:43:55\+0200, but some "):
        open_recording(file)
    (tmp_path / "rig.yaml").write_text("video_start_utc: 2024-05-31T14:43:55+0200\n")
    assert open_recording(file).gps.t_s.tolist() == [0.0]
