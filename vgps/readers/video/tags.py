"""What a video's tags say: maker, model, lens, time."""

import re
from pathlib import Path

import av

from vgps.readers.video.container import open_container
from vgps.readers.video.mp4_boxes import quicktime_tags

_APPLE = "com.apple.quicktime."
_TIMES = ("creationdate", "creation_time")  # the first has a zone
_SECOND = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d")


def video_tags(file: Path) -> dict[str, str | float]:
    """Return the tags of a video and of its tracks by name, without Apple's prefix; none if it is damaged."""
    try:
        with open_container(file) as container:
            tags: dict[str, str | float] = dict(container.metadata)
            for stream in container.streams.video:
                tags = {**stream.metadata, **tags}
        tags = {key.removeprefix(_APPLE): value for key, value in tags.items()}
        return {**tags, **quicktime_tags(file)}
    except (av.FFmpegError, OSError):
        return {}


def stated_time(file: Path) -> str | None:
    """Return the time that a video's tags state, as they write it; None without any."""
    tags = video_tags(file)
    times = (str(tags[name]) for name in _TIMES if name in tags)
    return next((time for time in times if _SECOND.match(time)), None)
