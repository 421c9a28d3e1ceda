"""ROS 1 and 2 bags and MCAP files: images, fixes, angular rates and calibration of one recording.

rosbags and mcap are in the extra ``ros``. Times are those of the messages' headers, the sensors' own.
"""

from collections.abc import Collection, Generator, Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np

from vgps.errors import GpsLogError, VideoError
from vgps.model import Camera, FixClass, FloatArray, Frame, GyroLog, RgbImage
from vgps.readers.bag_messages import IMAGES, bag_messages, grey_of, rgb_of, stamp_s
from vgps.readers.gps_formats.fixes import EPOCH, Clock, Fix, RawLog, skipped, uncertainty
from vgps.runtime.threads import run_ahead

_MAGIC = (b"#ROSBAG V2.0", b"\x89MCAP0\r\n")
_UTC_S = 1e9  # ROS times from here on are Unix times; smaller ones are a simulation's
_FIX, _RATES, _INFO = "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/Imu", "sensor_msgs/msg/CameraInfo"
_GBAS, _SBAS, _NO_FIX = 2, 1, -1
_RTK_FIX_M = 0.05  # a ground-based fix with a smaller horizontal sigma has its ambiguities fixed
_UNKNOWN = np.full((3, 3), np.nan)
_LENSES = {"plumb_bob": "opencv", "rational_polynomial": "opencv", "equidistant": "fisheye"}


def looks_like_bag(data: bytes) -> bool:
    """Whether the file begins as a ROS 1 bag or an MCAP file."""
    return data.startswith(_MAGIC)


def is_bag(path: Path) -> bool:
    """Whether a path is a ROS 1 bag, an MCAP file, or the folder of a ROS 2 bag."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() and (any(path.glob("*.db3")) or any(path.glob("*.mcap")))
    return path.suffix.lower() in {".bag", ".mcap"} and path.is_file()


def read_bag_fixes(path: Path) -> RawLog:
    """Read the fixes of a bag in UTC, for a recording whose video is elsewhere.

    Raises:
        GpsLogError: A library is missing, the file is damaged, or has no NavSatFix.
    """
    found = [(stamp_s(message), message) for _, _, message in bag_messages(path, (_FIX,))]
    return _fixes(found, 0.0, Clock.UTC, path)


class BagVideo:
    """The images of a bag as a video, and its other messages on the clock of the first image."""

    def __init__(self, path: Path, topic: str | None = None) -> None:
        """Read everything but the images' pixels.

        Args:
            path: The file or folder.
            topic: The topic of the images; None if there is one.

        Raises:
            VideoError: There are no images, or several topics of them and none is named.
            GpsLogError: A library is missing, or the file is damaged.
        """
        self.path, self.warnings = path, tuple[str, ...]()
        image_s: dict[str, list[float]] = {}  # by topic
        self._others: dict[str, list[tuple[float, Any]]] = {}  # times and messages, by kind
        for kind, name, message in bag_messages(path, (*IMAGES, _FIX, _RATES, _INFO)):
            if kind in IMAGES:
                image_s.setdefault(name, []).append(stamp_s(message))
            else:
                self._others.setdefault(kind, []).append((stamp_s(message), message))
        self._topic = _only(list(image_s), topic, path)
        stamps = np.array(image_s[self._topic])
        self._order = np.unique(stamps, return_index=True)[1]  # repeated instants are dropped
        self._origin_s = float(stamps[self._order[0]])
        self.times_s: FloatArray = stamps[self._order] - self._origin_s
        self.start_s = 0.0
        first = next(self.pictures([0]), None)
        if first is None:
            raise VideoError("the first image cannot be decoded", file=path, place=self._topic)
        self.height, self.width = first[1].shape[:2]

    @property
    def start_utc(self) -> datetime | None:
        """UTC of the first image; None on a simulation's clock."""
        if self._origin_s < _UTC_S:
            return None
        return EPOCH + timedelta(seconds=self._origin_s)

    def frames(self) -> Iterator[Frame]:
        """Yield all images in order of time, decoded ahead in a separate thread."""
        return run_ahead(self._frames)

    def pictures(self, wanted: Collection[int]) -> Iterator[tuple[int, RgbImage]]:
        """Yield index and colours of some images in order."""
        last = max(wanted, default=-1)
        for index, message in self._images():
            if index in wanted:
                yield index, rgb_of(message, self.path)
            if index >= last:
                return

    def fixes(self) -> RawLog:
        """Return the fixes on the clock of the first image; empty without any."""
        found = self._others.get(_FIX, [])
        return _fixes(found, self._origin_s, Clock.VIDEO, self.path) if found else RawLog(Clock.VIDEO, [])

    def gyro(self) -> GyroLog | None:
        """Return the angular rates in the sensor's axes; None without any."""
        found = self._others.get(_RATES, [])
        if not found:
            return None
        t_s, first = np.unique([t - self._origin_s for t, _ in found], return_index=True)
        rate = [[getattr(message.angular_velocity, axis) for axis in "xyz"] for _, message in found]
        return GyroLog(t_s, np.array(rate, float)[first], self.path)

    def camera(self) -> Camera | None:
        """Return the calibration of the first CameraInfo; None without one, or if it is empty.

        Raises:
            VideoError: Its lens model is unknown.
        """
        found = self._others.get(_INFO, [])
        return _camera(found[0][1], self.path) if found else None

    def _frames(self) -> Generator[Frame]:
        for index, message in self._images():
            yield Frame(index, float(self.times_s[index]), grey_of(message, self.path))

    def _images(self) -> Iterator[tuple[int, Any]]:
        """Yield index and message of the images in order of the bag, which is that of their times or near."""
        index_of = {int(row): index for index, row in enumerate(self._order)}
        number, waiting, following = -1, dict[int, Any](), 0
        for _, name, message in bag_messages(self.path, IMAGES):
            if name != self._topic:
                continue
            number += 1
            if number in index_of:
                waiting[index_of[number]] = message
            while following in waiting:
                yield following, waiting.pop(following)
                following += 1


def _only(topics: list[str], wanted: str | None, path: Path) -> str:
    if wanted in topics or (wanted is None and len(topics) == 1):
        return wanted or topics[0]
    found = f"several topics of images: {', '.join(topics)}" if topics else "no images"
    if wanted is not None:
        found = f"no images in {wanted}, but in {', '.join(topics) or 'no topic'}"
    raise VideoError(
        found,
        file=path,
        expected="sensor_msgs Image or CompressedImage",
        remedy="name one with --image-topic" if topics else None,
    )


def _fixes(found: list[tuple[float, Any]], origin_s: float, clock: Clock, path: Path) -> RawLog:
    if not found:
        raise GpsLogError("no fixes", file=path, expected="messages sensor_msgs/NavSatFix")
    fixes = [
        _fix(t_s - origin_s, message, row)
        for row, (t_s, message) in enumerate(found, 1)
        if message.status.status != _NO_FIX
    ]
    return RawLog(clock, fixes, skipped(len(found) - len(fixes), "message", "without a fix"))


def _fix(t_s: float, message: Any, row: int) -> Fix:
    """Return a NavSatFix, whose altitude is ellipsoidal by definition."""
    known = message.position_covariance_type > 0
    covariance = np.asarray(message.position_covariance, float).reshape(3, 3)
    sigma, correlation = uncertainty(covariance if known else _UNKNOWN)
    status = int(message.status.status)
    kind = FixClass.SBAS if status == _SBAS else FixClass.SINGLE
    if status == _GBAS:
        kind = FixClass.RTK_FIX if np.hypot(sigma[0], sigma[1]) < _RTK_FIX_M else FixClass.RTK_FLOAT
    place = float(message.latitude), float(message.longitude), float(message.altitude)
    return Fix(t_s, *place, kind, row, sigma, correlation=correlation)


def _camera(info: Any, path: Path) -> Camera | None:
    K = np.asarray(getattr(info, "k", getattr(info, "K", None)), float).reshape(3, 3)
    D = np.asarray(getattr(info, "d", getattr(info, "D", ())), float)
    if K[0, 0] <= 0.0:
        return None  # an uncalibrated driver publishes zeros
    name = str(info.distortion_model) or "plumb_bob"
    if name not in _LENSES:
        raise VideoError(
            f"lens model {name!r}", file=path, expected=", ".join(_LENSES), remedy="give --camera"
        )
    return Camera(
        model="pinhole" if not D.any() else _LENSES[name],  # type: ignore[arg-type]
        width=int(info.width),
        height=int(info.height),
        fx=float(K[0, 0]),
        fy=float(K[1, 1]),
        cx=float(K[0, 2]),
        cy=float(K[1, 2]),
        distortion=tuple(D.tolist()) if D.any() else (),
    )
