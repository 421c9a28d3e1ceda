"""EXIF and XMP in JPEG files, without touching their pixels."""

import io
import struct
from collections.abc import Iterator

from PIL import Image

from vgps.errors import VideoError

_APP1, _SCAN = 0xE1, 0xDA
_EXIF, _XMP = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0"
_LONGEST = 65533


def encoded(picture: Image.Image) -> bytes:
    """Return a picture as JPEG."""
    stream = io.BytesIO()
    picture.save(stream, "JPEG", quality=95, subsampling=0)
    return stream.getvalue()


def with_metadata(jpeg: bytes, exif: Image.Exif, xmp: str) -> bytes:
    """Return a JPEG file with other EXIF and XMP; every other byte is kept.

    Raises:
        VideoError: The file is not a JPEG, or the metadata are too long for one segment.
    """
    kept = b"".join(segment for segment in _segments(jpeg) if not segment[4:].startswith((_EXIF, _XMP)))
    return (
        jpeg[:2] + _segment(_EXIF, exif.tobytes().removeprefix(_EXIF)) + _segment(_XMP, xmp.encode()) + kept
    )


def _segment(name: bytes, content: bytes) -> bytes:
    if len(name) + len(content) > _LONGEST:
        raise VideoError(f"metadata of {len(content)} bytes", expected=f"at most {_LONGEST}, as JPEG has it")
    return struct.pack(">BBH", 0xFF, _APP1, 2 + len(name) + len(content)) + name + content


def _segments(jpeg: bytes) -> Iterator[bytes]:
    """Yield the segments after the start of a file; the last one is the image itself."""
    at = 2
    while True:
        if jpeg[:2] != b"\xff\xd8" or len(jpeg) < at + 4 or jpeg[at] != 0xFF:
            raise VideoError("not a JPEG file", expected="segments that begin with FF")
        if jpeg[at + 1] == _SCAN:
            yield jpeg[at:]
            return
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        yield jpeg[at:end]
        at = end
