"""What a file is that holds no fixes for vgps to read, and what to do about it."""

import re

_TO_POSITIONS = "compute positions with RTKLIB or a PPK service, and give the .pos"
_HEAD_BYTES = 4000
# in the head of a file
_KINDS = (
    (rb"RINEX VERS", f"RINEX has raw measurements or orbits, no positions; {_TO_POSITIONS}"),
    (rb"\AJP[0-9A-F]{3}RLOGF", f"a Javad or Topcon file (JPS) of raw measurements; {_TO_POSITIONS}"),
    (rb"\A\$@", f"SBF without PVTGeodetic; enable that block, or {_TO_POSITIONS}"),
    (rb"\A\xaaD[\x12\x13]", f"NovAtel without BESTPOS; log BESTPOS, or {_TO_POSITIONS}"),
    (rb"<kml\b", "this KML has no times (no gx:Track); give the receiver's own log"),
    (rb'"class":"TPV"', "gpsd's JSON is not read; record NMEA with gpspipe -r"),
    (
        rb'"(semanticSegments|timelineObjects|timelinePath)"',
        "Google's timeline has a place every few minutes; record a track with an app that writes GPX",
    ),
    (rb"\A(PK\x03\x04|\x1f\x8b)", "an archive (zip, KMZ, gz); give the file in it"),
)
_UBX_HEAD = b"\xb5\x62"
_UBX_RAW = _UBX_HEAD + b"\x02\x15"  # RXM-RAWX
_LONGEST_UBX = 2000  # bytes a message, on average
_RTCM_HEAD = re.compile(rb"\xd3[\x00-\x03]")
_RTCM_FRAME = 6  # bytes around the data of a frame: head, length, CRC
_RTCM_FRAMES = 3  # one behind the other, so that it is not by chance


def remedy(data: bytes) -> str | None:
    """Return what a file of no known format is and what to do, as far as that can be seen."""
    head = data[:_HEAD_BYTES]
    known = next((text for pattern, text in _KINDS if re.search(pattern, head)), None)
    if known is None and data.count(_UBX_HEAD) > len(data) / _LONGEST_UBX:
        raw = "UBX with raw measurements and" if _UBX_RAW in data else "UBX"
        return f"{raw} without NAV-PVT; enable that message, or convert the log to .pos with RTKLIB"
    if known is None and any(_frames(data, match.start()) for match in _RTCM_HEAD.finditer(data[:100_000])):
        return f"RTCM 3 has corrections or raw measurements, no positions; {_TO_POSITIONS}"
    if known is None and b"\0" in head:
        return "a binary file; if it is a receiver's, have it write NMEA, or convert it to NMEA or GPX"
    return known


def _frames(data: bytes, start: int) -> bool:
    """Whether several frames of RTCM 3 follow each other from here."""
    at = start
    for _ in range(_RTCM_FRAMES):
        if not _RTCM_HEAD.match(data, at):
            return False
        at += _RTCM_FRAME + int.from_bytes(data[at + 1 : at + 3], "big")
    return at <= len(data)
