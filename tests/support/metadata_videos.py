"""Videos with tracks of metadata or subtitles, as cameras write them."""

from fractions import Fraction
from pathlib import Path

import av
import numpy as np

_CLOCK = Fraction(1, 1000)


def write_metadata_video(
    path: Path, packets: list[tuple[float, bytes]], kind: str = "tx3g", tags: dict[str, str] | None = None
) -> Path:
    """A second of black at 10 Hz beside packets (time [s], data) of a track of that kind, four letters.

    FFmpeg writes no tracks of kinds that it does not know: a track of subtitles is renamed.
    """
    options = {"movflags": "use_metadata_tags"} if tags else {}
    with av.open(str(path), "w", options=options) as container:
        container.metadata.update(tags or {})
        picture = container.add_stream("libx264", rate=10)
        picture.width, picture.height, picture.pix_fmt = 64, 48, "yuv420p"
        track = container.add_mux_stream("mov_text")
        track.time_base = _CLOCK
        for _ in range(10):
            frame = av.VideoFrame.from_ndarray(np.zeros((48, 64), np.uint8), "gray")
            container.mux(picture.encode(frame.reformat(format="yuv420p")))
        container.mux(picture.encode())
        for t_s, data in packets:
            packet = av.Packet(data)
            packet.stream, packet.time_base = track, _CLOCK
            packet.pts = packet.dts = round(1000 * t_s)
            packet.duration = 100
            container.mux(packet)
    if kind != "tx3g":
        written = path.read_bytes()
        assert written.count(b"tx3g") == written.count(b"sbtl") == 1
        path.write_bytes(written.replace(b"tx3g", kind.encode()).replace(b"sbtl", b"meta"))
    return path


def subtitle_packet(text: str) -> bytes:
    return len(text.encode()).to_bytes(2, "big") + text.encode()
