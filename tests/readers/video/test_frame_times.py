import pytest
from clips import checked_frames, limited, shade, write_clip

from vgps.errors import VideoError
from vgps.readers.video.video_file import VideoFile


def test_frame_times_override(tmp_path):
    path = write_clip(tmp_path / "v.mp4", frames=3)
    table = tmp_path / "frame_times.csv"
    table.write_text("frame,t_s\n0,7.0\n1,7.25\n2,7.75\n")
    video = VideoFile(path, table)
    assert video.times_s.tolist() == [0.0, 0.25, 0.75]
    assert video.start_s == 7.0
    assert [int(f.gray[40, 40]) for f in checked_frames(video)] == pytest.approx(
        [limited(shade(i)) for i in range(3)], abs=3
    )
    table.write_text("frame,t_s\n0,7.0\n1,7.25\n")
    with pytest.raises(VideoError, match=r"frame_times\.csv: 2 times; expected 3"):
        VideoFile(path, table)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,0\n2,1\n", "line 3: frame 2; expected frame 1"),
        ("0,0\n1,0\n", "line 3: t_s 0; expected a time later"),
        ("0,0\n1,1e999\n", "line 3: t_s inf; expected a time later"),
        ("0,0\n1,nan\n", "line 3: t_s nan"),
        ("0,0\n1,soon\n", "line 3: 'soon' in column t_s; expected a number"),
        ("", "no rows"),
    ],
)
def test_wrong_frame_times_are_refused(tmp_path, rows, message):
    path = write_clip(tmp_path / "v.mp4", frames=2)
    (tmp_path / "t.csv").write_text("frame,t_s\n" + rows)
    with pytest.raises(VideoError, match=message):
        VideoFile(path, tmp_path / "t.csv")
