"""Messages of ROS 1 and 2 bags and MCAP files, and the pixels of their images."""

import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from vgps.config.yaml_text import YamlTextError, parse_yaml
from vgps.errors import GpsLogError, VideoError
from vgps.model import GrayImage, RgbImage
from vgps.readers.extras import optional_module
from vgps.readers.video.container import check_size

IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
_LUMA = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601
# channels of an encoding, and where red, green and blue are among them
_ENCODINGS = {
    "mono8": (1, (0, 0, 0)),
    "8UC1": (1, (0, 0, 0)),
    "rgb8": (3, (0, 1, 2)),
    "bgr8": (3, (2, 1, 0)),
    "8UC3": (3, (2, 1, 0)),
    "rgba8": (4, (0, 1, 2)),
    "bgra8": (4, (2, 1, 0)),
    "mono16": (2, (1, 1, 1)),
}


def bag_messages(path: Path, kinds: tuple[str, ...]) -> Iterator[tuple[str, str, Any]]:
    """Yield kind (``sensor_msgs/msg/Imu``), topic and message of the kinds given, in the file's order.

    Raises:
        GpsLogError: A library is missing, or the file is damaged.
    """
    source = _mcap(path, kinds) if path.suffix.lower() == ".mcap" else _bag(path, kinds)
    try:
        yield from source
    except (GpsLogError, VideoError, GeneratorExit):
        raise
    except Exception as error:  # what the libraries raise on damaged bytes is not documented
        raise GpsLogError(
            f"damaged bag ({error})", file=path, remedy="reindex it, or record it again"
        ) from error


def stamp_s(message: Any) -> float:
    """Return the time of a message's header, seconds."""
    stamp = message.header.stamp
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


def grey_of(message: Any, path: Path) -> GrayImage:
    """Return the luminance (H, W) of an Image or CompressedImage.

    Raises:
        VideoError: The encoding is unknown, or the picture damaged.
    """
    if hasattr(message, "format"):
        return np.asarray(_compressed(message, path).convert("L"))
    channels, order = _encoding(message, path)
    values = _values(message, channels, path)
    if len(set(order)) == 1:
        return np.ascontiguousarray(values[..., order[0]])
    return np.asarray(np.rint(values[..., list(order)] @ _LUMA), np.uint8)


def rgb_of(message: Any, path: Path) -> RgbImage:
    """Return the colours (H, W, 3); raises as `grey_of`."""
    if hasattr(message, "format"):
        return np.asarray(_compressed(message, path).convert("RGB"))
    channels, order = _encoding(message, path)
    return np.ascontiguousarray(_values(message, channels, path)[..., list(order)])


def _encoding(message: Any, path: Path) -> tuple[int, tuple[int, int, int]]:
    found = _ENCODINGS.get(str(message.encoding))
    if found is None:
        raise VideoError(
            f"images of encoding {message.encoding!r}", file=path, expected=", ".join(_ENCODINGS)
        )
    # the upper byte of 16 bits
    return (2, (0, 0, 0)) if found[0] == 2 and message.is_bigendian else found


def _values(message: Any, channels: int, path: Path) -> RgbImage:
    height, width, step = int(message.height), int(message.width), int(message.step)
    check_size(width, height, path, image=True)
    if min(width, height) < 1 or step < width * channels or len(message.data) != height * step:
        raise VideoError(
            f"an image of {len(message.data)} bytes", file=path, expected=f"{height} rows of {step} bytes"
        )
    rows = np.asarray(message.data, np.uint8).reshape(height, step)
    return rows[:, : width * channels].reshape(height, width, channels)


def _compressed(message: Any, path: Path) -> Image.Image:
    try:
        picture = Image.open(io.BytesIO(bytes(message.data)))
        check_size(*picture.size, path, image=True)
        picture.load()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise VideoError(f"a compressed image that cannot be decoded ({error})", file=path) from error
    return picture


def _bag(path: Path, kinds: tuple[str, ...]) -> Iterator[tuple[str, str, Any]]:
    read, highlevel = _deserialisers(path), optional_module("rosbags.highlevel", "ros", path)
    _check_metadata(path / "metadata.yaml")
    typesys = optional_module("rosbags.typesys", "ros", path)
    # bags of ROS 2 before Iron have no definitions
    default = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with highlevel.AnyReader([path], default_typestore=default) as reader:
        connections = [one for one in reader.connections if one.msgtype in kinds]
        encoding = "cdr" if reader.is2 else "ros1"
        for connection, _, raw in reader.messages(connections=connections) if connections else ():
            yield connection.msgtype, connection.topic, read[encoding](raw, connection.msgtype)


def _check_metadata(file: Path) -> None:
    """Check what rosbags parses without bounds: aliases may stand for more than any memory holds.

    Raises:
        GpsLogError: A ROS 2 bag's metadata is not YAML, or absurdly long.
    """
    if not file.is_file():  # ROS 1
        return
    try:
        parse_yaml(file.read_bytes())
    except YamlTextError as error:
        raise GpsLogError(
            error.problem,
            file=file,
            place=None if error.line is None else f"line {error.line}",
            remedy="reindex it: ros2 bag reindex FOLDER",
        ) from error


def _mcap(path: Path, kinds: tuple[str, ...]) -> Iterator[tuple[str, str, Any]]:
    read, reading = _deserialisers(path), optional_module("mcap.reader", "ros", path)
    with path.open("rb") as stream:
        for schema, channel, message in reading.make_reader(stream).iter_messages():
            kind = _full_name(schema.name) if schema is not None else ""
            if kind in kinds:
                yield kind, channel.topic, read[channel.message_encoding](message.data, kind)


def _deserialisers(path: Path) -> dict[str, Callable[[bytes, str], Any]]:
    """Return the functions that read a message, by its encoding.

    The definitions are those of ROS, which have not changed for these kinds, not those that a file has.
    """
    typesys = optional_module("rosbags.typesys", "ros", path)
    ros1, ros2 = (
        typesys.get_typestore(one) for one in (typesys.Stores.ROS1_NOETIC, typesys.Stores.ROS2_HUMBLE)
    )
    return {"ros1": ros1.deserialize_ros1, "cdr": ros2.deserialize_cdr}


def _full_name(name: str) -> str:
    """Return ``sensor_msgs/msg/Imu`` of ``sensor_msgs/Imu`` too, as ROS 1 names it."""
    parts = name.split("/")
    return name if len(parts) == 3 else f"{parts[0]}/msg/{parts[-1]}"
