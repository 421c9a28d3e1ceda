"""The video whose frames a run poses, for those who show or export its pictures."""

from pathlib import Path

from vgps.errors import VgpsError
from vgps.model import Camera
from vgps.readers.recording import open_recording
from vgps.readers.sources import Source, open_video
from vgps.readers.views.steady import SteadyVideo
from vgps.readers.views.view import ViewVideo

RunVideo = Source | ViewVideo | SteadyVideo


def open_posed_video(place: Path, camera: Camera) -> RunVideo:
    """Return the video of a recording, or the view of this camera into its wide picture.

    Where the camera's focal length changes, pictures are scaled as those of the run.

    Raises:
        RecordingError, VideoError: There is none, or it cannot be read.
    """
    video = _of_size(place, camera)
    return video if camera.focal_changes is None else SteadyVideo(video, camera.focal_changes)


def _of_size(place: Path, camera: Camera) -> Source | ViewVideo:
    video = open_video(place)
    if (video.width, video.height) == (camera.width, camera.height):
        return video
    try:
        posed = open_recording(place, with_gps=False, cameras=False).video
    except VgpsError:
        return video  # pictures of another size, without files that fit them
    return posed if isinstance(posed, ViewVideo) else video
