"""Where the frames of a recording are: a video, a folder of images, or a bag."""

from pathlib import Path

from vgps.errors import RecordingError
from vgps.readers.bag import BagVideo, is_bag
from vgps.readers.gopro.chapters import ChapteredVideo, chapters_of
from vgps.readers.gopro.gpmf import Telemetry, read_gpmf
from vgps.readers.video.frame_times import FRAME_TIMES
from vgps.readers.video.images import ImageFolder, list_images
from vgps.readers.video.masks import MASKS
from vgps.readers.video.video_file import VideoFile

_SUFFIXES = (".mp4", ".mov", ".avi", ".mkv", ".m4v")
PathLike = str | Path
Source = VideoFile | ChapteredVideo | ImageFolder | BagVideo


def open_video(path: PathLike) -> Source:
    """Return the video or the folder of images of a recording, or beside it, without the other files.

    Raises:
        RecordingError, VideoError: There is none, or it cannot be read.
    """
    return opened(place_of(Path(path))[1])


def is_image_folder(path: Path) -> bool:
    """Whether a path is a folder of images, and not that of a ROS 2 bag."""
    return path.is_dir() and not is_bag(path)


def place_of(path: Path) -> tuple[Path, Path]:
    """Return the folder of the other files, and the video, bag or folder of images.

    Raises:
        RecordingError: There is none, or several.
    """
    if path.is_file() or is_bag(path):
        return path.parent, path
    if not path.is_dir():
        raise RecordingError(
            "no such recording", file=path, expected="a folder with video.mp4 and camera.yaml, or a video"
        )
    videos = [file for suffix in _SUFFIXES if (file := path / f"video{suffix}").is_file()]
    videos += [file for file in sorted(path.iterdir()) if file.stem == "video" and is_bag(file)]
    if len(videos) > 1:
        names = ", ".join(file.name for file in videos)
        raise RecordingError(
            f"several videos: {names}", file=path, remedy="name one of them as the recording"
        )
    if videos:
        return path, videos[0]
    inner = sorted(sub for sub in path.iterdir() if sub.is_dir() and sub.name != MASKS and list_images(sub))
    if list_images(path):
        # a folder of images: the other files are in it, or beside it
        inside = any((path / name).is_file() for name in ("camera.yaml", "rig.yaml"))
        return (path if inside else path.parent), path
    if len(inner) == 1:
        return path, inner[0]
    alone = _only_video(path)
    if alone is not None and not inner:
        return path, alone
    found = f"several folders of images: {', '.join(sub.name for sub in inner)}" if inner else "no video"
    raise RecordingError(
        found,
        file=path,
        expected="video.mp4, video.mov, video.avi, a bag named video or one folder of images",
    )


def _only_video(folder: Path) -> Path | None:
    """Return the only video of a folder, whatever its name; later chapters do not count."""
    videos = [file for file in sorted(folder.iterdir()) if file.suffix.lower() in _SUFFIXES]
    later = {chapter for file in videos for chapter in chapters_of(file)[1:]}
    first = [file for file in videos if file not in later]
    return first[0] if len(first) == 1 else None


def opened(path: Path, topic: str | None = None) -> Source:
    """Open a video with the chapters beside it, a bag or a folder of images; ``topic`` is that of a bag."""
    if is_bag(path):
        return BagVideo(path, topic)
    if path.is_dir():
        return ImageFolder(path)
    table = path.parent / FRAME_TIMES
    if table.is_file():
        return VideoFile(path, table)
    files = chapters_of(path)
    return VideoFile(path) if len(files) == 1 else ChapteredVideo(files)


def telemetry_of(video: Source) -> Telemetry:
    """Return a GoPro's metadata in a video, of all its chapters; empty for others."""
    if isinstance(video, ChapteredVideo):
        return video.telemetry()
    return read_gpmf(video.path) if isinstance(video, VideoFile) else Telemetry(video.path)
