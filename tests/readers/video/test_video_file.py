from pathlib import Path

import av
import numpy as np
import pytest
from clips import checked_frames, limited, noise, shade, write_clip

from vgps.errors import VideoError
from vgps.readers.video.video_file import VideoFile


@pytest.mark.parametrize(
    ("name", "codec", "options"),
    [
        ("b_frames.mp4", "libx264", {"bf": "3", "b-pyramid": "normal"}),
        ("b_frames.mov", "libx264", {"bf": "3"}),
        ("b_frames.avi", "libx264", {"bf": "3"}),
        ("mpeg4.avi", "mpeg4", {"bf": "2"}),
        ("b_frames.mkv", "libx264", {"bf": "3"}),
    ],
)
def test_frames_come_in_order_with_their_times(tmp_path, name, codec, options):
    video = VideoFile(write_clip(tmp_path / name, codec=codec, options=options))
    np.testing.assert_allclose(video.times_s, np.arange(10) / 10, atol=1e-9)
    assert (video.width, video.height) == (64, 48)
    grays = [int(frame.gray[40, 40]) for frame in checked_frames(video)]
    np.testing.assert_allclose(grays, [limited(shade(i)) for i in range(10)], atol=3)
    assert video.warnings == ()


def test_variable_rate_keeps_every_time(tmp_path):
    pts = [500, 600, 650, 900, 901, 1400, 1500, 1510, 1800, 1900]
    video = VideoFile(write_clip(tmp_path / "v.mp4", pts))
    np.testing.assert_allclose(video.times_s, (np.array(pts) - 500) / 1000, atol=1e-9)
    grays = [int(frame.gray[40, 40]) for frame in checked_frames(video)]
    np.testing.assert_allclose(grays, [limited(shade(i)) for i in range(10)], atol=3)


@pytest.mark.slow
def test_damage_in_the_middle_costs_only_its_frames(tmp_path):
    path = write_clip(tmp_path / "v.mp4", frames=40, draw=noise, options={"g": "10"})
    clean = [frame.gray for frame in VideoFile(path).frames()]
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + len(data) // 10] = bytes(len(data) // 10)
    path.write_bytes(data)
    video = VideoFile(path)
    frames = checked_frames(video)
    assert len(frames) == 40
    lost = [frame.index for frame in frames if not frame.gray.any()]
    assert lost
    assert any(
        f"{len(lost)} of 40 frames cannot be decoded, first frame {lost[0]}" in w for w in video.warnings
    )
    for frame in (*frames[:10], *frames[-5:]):
        np.testing.assert_array_equal(frame.gray, clean[frame.index])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["v.mp4", "v.mkv"])
def test_a_cut_file_gives_the_frames_up_to_there(tmp_path, name):
    path = write_clip(
        tmp_path / name,
        frames=40,
        draw=noise,
        options={"bf": "0"},
        container_options={"movflags": "faststart"} if name.endswith("mp4") else None,
    )
    clean = [frame.gray for frame in VideoFile(path).frames()]
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    video = VideoFile(path)
    frames = checked_frames(video)
    assert 20 <= len(frames) <= 25
    for frame in frames:
        np.testing.assert_array_equal(frame.gray, clean[frame.index])
    assert name.endswith("mkv") or "truncated" in video.warnings[0]


@pytest.mark.slow
@pytest.mark.parametrize("gone", [lambda path: path.write_bytes(b""), lambda path: path.unlink()])
def test_a_video_that_vanishes_while_it_is_read_is_said(tmp_path, gone):
    path = write_clip(tmp_path / "v.mp4", frames=40, draw=noise)
    video = VideoFile(path)
    frames = video.frames()
    next(frames)
    # what is lost by then depends on how far ahead the reader is
    gone(path)
    rest = list(frames)
    assert len(rest) == 39
    lost = [frame.index for frame in rest if not frame.gray.any()]
    assert bool(lost) == bool(video.warnings)
    assert all("the file changed while it was read" in text for text in video.warnings)
    path.unlink(missing_ok=True)
    with pytest.raises(VideoError, match=r"v\.mp4: cannot be read as a video"):
        list(video.frames())


@pytest.mark.parametrize("content", [b"", b"hello\n", b"\x00" * 1000, None])
def test_a_file_that_is_not_a_video_is_refused(tmp_path, content):
    path = tmp_path / "v.mp4"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(VideoError, match=r"v\.mp4"):
        VideoFile(path)


def test_a_stream_without_times_needs_a_table(tmp_path):
    path = write_clip(tmp_path / "v.h264", frames=3)
    with pytest.raises(VideoError, match=r"frame_times\.csv"):
        VideoFile(path)
    (tmp_path / "t.csv").write_text("frame,t_s\n0,0\n1,0.1\n2,0.3\n")
    video = VideoFile(path, tmp_path / "t.csv")
    assert video.times_s.tolist() == [0, 0.1, 0.3]
    assert len(checked_frames(video)) == 3


def test_sound_alone_is_no_video(tmp_path):
    path = tmp_path / "v.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=48000)
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 48000), np.float32), format="fltp", layout="mono")
        frame.sample_rate = 48000
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    with pytest.raises(VideoError, match="no video stream"):
        VideoFile(path)


@pytest.mark.parametrize(
    ("folder", "count", "step"),
    [("kitti03", 801, 0.1), ("gopro_walk", 315, 1001 / 30000), ("phone_gyro", 103, None)],
)
def test_real_videos_have_their_frames_at_their_times(data_dir: Path, folder, count, step):
    table = data_dir / folder / "frame_times.csv"
    video = VideoFile(data_dir / folder / "video.mp4", table if step is None else None)
    assert len(video.times_s) == count
    if step is not None:
        np.testing.assert_allclose(video.times_s, np.arange(count) * step, atol=1e-9)
    frames = video.frames()
    for _, frame in zip(range(5), frames, strict=False):
        assert frame.gray.std() > 10
    frames.close()


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["kitti07", "kitti03_shake", "gopro_walk", "phone_gyro"])
def test_every_real_frame_has_its_time(data_dir: Path, folder):
    video = VideoFile(data_dir / folder / "video.mp4")
    count = 0
    for count, frame in enumerate(video.frames(), 1):
        assert (frame.index, frame.t_s) == (count - 1, video.times_s[count - 1])
        assert frame.gray.any()
    assert count == len(video.times_s)
    assert video.warnings == ()
