"""A recording with its video encoded again: another disturbance of every pixel, the same drive."""

from dataclasses import replace
from pathlib import Path

import av

from vgps.model import Recording
from vgps.readers.video.video_file import VideoFile


def reencoded(recording: Recording, out: Path, crf: int) -> Recording:
    """Return a recording with its video encoded again as H.264, frame by frame with the same times.

    Args:
        recording: Its video is a file without a list of frame times.
        out: The new video.
        crf: Quality as x264 counts it: 18 is hardly seen, 34 is coarse.
    """
    options = {"crf": str(crf), "preset": "veryfast", "x264-params": "mbtree=0"}
    with av.open(str(recording.video.path)) as source, av.open(str(out), "w") as sink:
        video = source.streams.video[0]
        copy = sink.add_stream("libx264", rate=video.average_rate, options=options)
        copy.width, copy.height, copy.pix_fmt = video.width, video.height, "yuv420p"
        copy.codec_context.thread_count = 1  # more threads do not reproduce the bytes
        if video.time_base is not None:
            copy.codec_context.time_base = video.time_base
        for picture in source.decode(video):
            picture.pict_type = av.video.frame.PictureType.NONE  # the encoder chooses its own key frames
            sink.mux(copy.encode(picture))
        sink.mux(copy.encode(None))
    return replace(recording, video=VideoFile(out))
