import av
import pytest
from clips import write_clip
from gpmf_bytes import device, text
from metadata_videos import box, with_box

from vgps.errors import VideoError
from vgps.readers.recording import open_recording

CAMERA = "model: pinhole\nwidth: 64\nheight: 48\nfx: 60\nfy: 80\ncx: 31.5\ncy: 23.5\n"


@pytest.mark.parametrize(
    ("names", "content"),
    [
        (("moov", "trak", "mdia", "minf", "stbl", "stsd"), bytes(16) + box(b"sv3d", bytes(8))),
        (("moov", "trak", "uuid"), b"\xff\xcc" + b"<GSpherical:Spherical>true</GSpherical:Spherical>"),
        (("moov", "udta", "GPMF"), device("Global Settings", text("PRJT", "EACO"))),
    ],
)
def test_a_picture_of_the_whole_sphere_is_refused(tmp_path, names, content):
    file = with_box(write_clip(tmp_path / "VID.mp4"), *names, content=content)
    with pytest.raises(VideoError, match="the whole sphere; expected that of one lens; give the videos"):
        open_recording(file)


def test_a_gopro_s_picture_of_one_lens_is_none(tmp_path):
    settings = device("Global Settings", text("PRJT", "GPRO"))
    file = with_box(write_clip(tmp_path / "VID.mp4"), "moov", "udta", "GPMF", content=settings)
    assert open_recording(file).video.width == 64


def test_pixels_that_are_not_square_need_a_calibration(tmp_path):
    file = write_clip(tmp_path / "video.mp4", options={"x264-params": "sar=4/3"})
    with pytest.raises(VideoError, match="pixels of 4 : 3; expected square ones, or a calibration"):
        open_recording(file)
    (tmp_path / "camera.yaml").write_text(CAMERA)
    assert open_recording(file).camera.fy == 80.0


def test_pixels_that_are_nearly_square_are(tmp_path):
    assert open_recording(write_clip(tmp_path / "v.mp4", options={"x264-params": "sar=1280/1281"})).guesses


@pytest.mark.parametrize(("sizes", "named"), [([(64, 48)] * 2, True), ([(64, 48), (32, 24)], False)])
def test_another_lens_in_the_file_is_named(tmp_path, caplog, sizes, named):
    """A smaller picture is a thumbnail."""
    with av.open(str(tmp_path / "VID.insv.mp4"), "w") as container:
        streams = [container.add_stream("libx264", rate=10) for _ in sizes]
        for stream, (stream.width, stream.height) in zip(streams, sizes, strict=True):
            stream.pix_fmt = "yuv420p"
        for stream in streams:
            container.mux(stream.encode(av.VideoFrame(stream.width, stream.height, "yuv420p")))
            container.mux(stream.encode())
    open_recording(tmp_path / "VID.insv.mp4")
    assert ("has 2 tracks of pictures, of which one is used" in caplog.text) is named
