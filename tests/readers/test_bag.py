"""Bags written by rosbags and mcap from the simulated recording, as a robot records."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from bags import UNIX_S, write_mcap, write_ros1, write_ros2

from vgps.errors import GpsLogError, VgpsError, VideoError
from vgps.model import FixClass
from vgps.readers.bag import BagVideo
from vgps.readers.gps import gps_format, read_gps_log
from vgps.readers.recording import open_recording

pytest.importorskip("rosbags")
WRITERS = {"walk.bag": write_ros1, "walk": write_ros2, "walk.mcap": write_mcap}


@pytest.fixture(scope="module", params=WRITERS)
def bag(request, recording, tmp_path_factory):
    out = tmp_path_factory.mktemp("bag") / request.param
    WRITERS[request.param](recording, out, every=10, raw=request.param == "walk")
    return out


@pytest.mark.slow
def test_every_stream_is_on_the_clock_of_the_first_image(bag, recording):
    found, true = open_recording(bag), open_recording(recording)
    every = true.video.times_s[::10]
    np.testing.assert_allclose(found.video.times_s, every, atol=1e-6)
    assert (found.video.width, found.video.height) == (true.video.width, true.video.height)
    assert found.camera == replace(true.camera, readout_s=None)  # a CameraInfo does not say it
    np.testing.assert_allclose(found.gps.t_s, true.gps.t_s, atol=1e-6)
    for name in ("latitude_deg", "longitude_deg"):
        np.testing.assert_allclose(getattr(found.gps, name), getattr(true.gps, name), atol=1e-12)
    np.testing.assert_allclose(found.gps.height_m, true.gps.height_m, atol=1e-9)
    np.testing.assert_allclose(found.gps.sigma_m, true.gps.sigma_m, atol=1e-9)
    np.testing.assert_allclose(found.gps.correlation[0], [0.5, 0.0, 0.25], atol=1e-9)
    assert set(found.gps.fix_class) == {FixClass.RTK_FIX}
    np.testing.assert_allclose(found.gyro.rate_rad_s, true.gyro.rate_rad_s[::10], atol=1e-12)
    assert found.rig.video_start_utc == datetime.fromtimestamp(UNIX_S, UTC)


@pytest.mark.slow
def test_images_are_those_of_the_video(bag, recording):
    found, true = open_recording(bag).video, open_recording(recording).video
    # the video stores its luminance from 16 to 235
    grey = {one.index: (one.gray - 16.0) * 255 / 219 for one in true.frames() if one.index % 10 == 0}
    frames = list(found.frames())
    assert len(frames) == len(grey)
    for frame in frames:
        assert np.abs(frame.gray - grey[10 * frame.index]).mean() < 2.0
    ((index, picture),) = found.pictures([3])
    assert index == 3 and picture.shape == (*grey[0].shape, 3)


@pytest.mark.slow
def test_fixes_of_a_bag_beside_another_video(bag, recording, tmp_path):
    if bag.is_dir():
        pytest.skip("a GPS log is a file")
    assert gps_format(bag) == "bag"
    log = read_gps_log(bag, open_recording(recording).rig)
    np.testing.assert_allclose(log.t_s, open_recording(recording).gps.t_s, atol=1e-6)


@pytest.mark.slow
def test_a_truncated_bag_is_refused_in_a_line(bag, tmp_path):
    if bag.is_dir():
        pytest.skip("cut where the file is one")
    cut = tmp_path / bag.name
    cut.write_bytes(bag.read_bytes()[:5000])
    with pytest.raises(VgpsError) as refused:
        open_recording(cut)
    assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_several_topics_of_images_need_a_name(recording, tmp_path, monkeypatch):
    import bags

    whole = bags.messages

    def twice(*given, **how):
        for topic, kind, stamp, message in whole(*given, **how):
            yield topic, kind, stamp, message
            if topic == "/camera/image":
                yield "/left/image", kind, stamp, message

    monkeypatch.setattr(bags, "messages", twice)
    write_mcap(recording, tmp_path / "two.mcap", every=40)
    with pytest.raises(VideoError, match=r"several topics of images: /camera/image, /left/.* --image-topic"):
        open_recording(tmp_path / "two.mcap")
    assert len(open_recording(tmp_path / "two.mcap", image_topic="/left/image").video.times_s) > 1
    with pytest.raises(VideoError, match="no images in /right, but in /camera/image, /left/image"):
        open_recording(tmp_path / "two.mcap", image_topic="/right")


@pytest.mark.slow
def test_a_bag_without_what_is_asked_for_says_so(tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "empty.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()
    with pytest.raises(VideoError, match="no images; expected sensor_msgs Image or CompressedImage"):
        open_recording(tmp_path / "empty.mcap")
    with pytest.raises(GpsLogError, match="no fixes; expected messages sensor_msgs/NavSatFix"):
        read_gps_log(tmp_path / "empty.mcap")


def test_metadata_whose_aliases_fill_the_memory_are_refused(tmp_path):
    folder = tmp_path / "rosbag2"
    folder.mkdir()
    (folder / "drive.db3").touch()
    levels = [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 12)]
    (folder / "metadata.yaml").write_text("\n".join(["a0: &a0 [1]", *levels]), encoding="utf-8")
    with pytest.raises(GpsLogError, match=r"metadata.yaml.*too many values"):
        BagVideo(folder)
