"""Images with their poses written into them: EXIF (2.32) and XMP (Pix4D's names for accuracy and angles)."""

import math
import warnings
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import IFDRational
from scipy.spatial.transform import Rotation

from vgps.model import FloatArray
from vgps.readers.video.images import ImageFolder
from vgps.writers.export_job import ExportJob
from vgps.writers.jpeg import encoded, with_metadata

MARK = "georeference.txt"
_GPS_IFD, _EXIF_IFD, _SOFTWARE = 0x8825, 0x8769, 0x0131
_ENU_R_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
# Pix4D's body: x to the image's top, y to its right, z along the optical axis
_CAMERA_R_BODY = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_XMP = """<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?>
<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:Camera="http://pix4d.com/camera/1.0"{}/>
</rdf:RDF></x:xmpmeta><?xpacket end="w"?>"""


def write_exif(job: ExportJob, folder: Path) -> None:
    """Write the frames, or copies of an image folder's files, with position, accuracy, heading, DOP and time.

    JPEG files of a folder keep their pixels and their other metadata; other images become JPEG. The altitude
    is above the geoid if one is given, as EXIF's "sea level" means it, else above the ellipsoid; ``VertCS``
    in XMP and the file georeference.txt say which.

    Raises:
        RunFolderError: The run is not georeferenced, or there are no frames.
        VideoError: An image cannot be decoded or is no JPEG.
    """
    system = job.georeferenced
    for row, name, jpeg in _images(job):
        exif = Image.Exif()
        exif.load(_old_exif(jpeg))
        (folder / name).write_bytes(with_metadata(jpeg, _exif(exif, job, row), _xmp(job, row)))
    (folder / MARK).write_text(
        f"positions: WGS 84\nGPSAltitude: {system.height_datum}\nGPSHPositioningError: standard deviation "
        "of the horizontal position\nCamera:Yaw, Pitch, Roll: of the image's top, right and optical axis "
        "against north, east, down; all 0 for a picture straight down with its top to the north\n",
        encoding="utf-8",
    )


def _images(job: ExportJob) -> Iterator[tuple[int, str, bytes]]:
    """Yield row, name and JPEG of every frame chosen."""
    if not isinstance(job.video, ImageFolder):
        for row, picture in job.pictures():
            yield row, job.jpeg_names[row], encoded(Image.fromarray(picture))
        return
    for row, (number, name) in enumerate(zip(job.frame.tolist(), job.jpeg_names, strict=True)):
        file = job.video.files[number]
        if file.name == name:
            yield row, name, file.read_bytes()
            continue
        for _, picture in job.video.pictures([number]):
            yield row, name, encoded(Image.fromarray(picture))


def _old_exif(jpeg: bytes) -> bytes:
    at = jpeg.find(b"Exif\0\0", 0, 1 << 16)
    if at < 4:
        return b""
    length = int.from_bytes(jpeg[at - 2 : at], "big") - 2
    return jpeg[at : at + length]


def _exif(exif: Image.Exif, job: ExportJob, row: int) -> Image.Exif:
    exif[_SOFTWARE] = "vgps"
    gps, utc = _gps_tags(job, row), job.utc
    if utc is not None:
        gps |= {
            0x1D: utc[row].strftime("%Y:%m:%d"),
            0x07: (_ratio(utc[row].hour, 1), _ratio(utc[row].minute, 1), _seconds(utc[row])),
        }
        exif.get_ifd(_EXIF_IFD).update(_time_tags(utc[row]))
    exif.get_ifd(_GPS_IFD).clear()
    exif.get_ifd(_GPS_IFD).update(gps)
    return exif


def _gps_tags(job: ExportJob, row: int) -> dict[int, object]:
    """Return the tags of the GPS IFD: 1-4 position, 5-6 altitude, 11 DOP, 16-18 heading, 31 accuracy."""
    latitude, longitude, _ = job.geodetic[row].tolist()
    altitude = float(job.coordinates[row, 2])
    tags: dict[int, object] = {
        0x00: b"\x02\x03\x00\x00",
        0x01: "N" if latitude >= 0 else "S",
        0x02: _degrees(latitude),
        0x03: "E" if longitude >= 0 else "W",
        0x04: _degrees(longitude),
        0x05: b"\x00" if altitude >= 0 else b"\x01",
        0x06: _ratio(abs(altitude), 10_000),
        0x12: "WGS-84",
    }
    heading, sigma = float(job.heading_deg[row]), float(np.hypot(*job.solution.sigma_position_m[row, :2]))
    if math.isfinite(heading):
        tags |= {0x10: "T", 0x11: _ratio(heading, 10_000)}
    if math.isfinite(sigma):
        tags[0x1F] = _ratio(sigma, 10_000)
    hdop = _hdop(job, row)
    if math.isfinite(hdop):
        tags |= {0x0A: "3", 0x0B: _ratio(hdop, 100)}
    return tags


def _time_tags(utc: datetime) -> dict[int, object]:
    """Return DateTimeOriginal, OffsetTimeOriginal and SubSecTimeOriginal."""
    return {
        0x9003: utc.strftime("%Y:%m:%d %H:%M:%S"),
        0x9011: "+00:00",
        0x9291: f"{utc.microsecond:06d}",
    }


def _hdop(job: ExportJob, row: int) -> float:
    """Return the dilution of the nearest used fix; NaN if there is none."""
    if job.solution.judged_fixes is None:
        return math.nan
    log, table = job.solution.judged_fixes
    if not table.used.any():
        return math.nan
    times, hdop = job.solution.fix_times_s[table.used], log.hdop[table.used]
    return float(hdop[np.argmin(np.abs(times - job.solution.t_s[row]))])


def _xmp(job: ExportJob, row: int) -> str:
    sigma = job.solution.sigma_position_m[row]
    yaw, pitch, roll = pix4d_angles_deg(job.local_R_camera[row])
    values = {"HorizCS": "EPSG:4326", "VertCS": escape(job.georeferenced.height_datum, {'"': "&quot;"})}
    values |= {"Yaw": f"{yaw:.6f}", "Pitch": f"{pitch:.6f}", "Roll": f"{roll:.6f}"}
    if np.isfinite(sigma).all():
        values |= {"GPSXYAccuracy": f"{np.hypot(*sigma[:2]):.4f}", "GPSZAccuracy": f"{sigma[2]:.4f}"}
    return _XMP.format("".join(f'\n Camera:{key}="{value}"' for key, value in values.items()))


def pix4d_angles_deg(local_R_camera: FloatArray) -> tuple[float, float, float]:
    """Return yaw, pitch, roll [deg]: turns about z, y, x from north, east, down to the camera's body."""
    ned_R_body = Rotation.from_matrix(_ENU_R_NED.T @ local_R_camera @ _CAMERA_R_BODY)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # towards the horizon, yaw and roll are one angle
        yaw, pitch, roll = ned_R_body.as_euler("ZYX", degrees=True).tolist()
    return yaw, pitch, roll


def _degrees(angle: float) -> tuple[IFDRational, IFDRational, IFDRational]:
    """Return degrees, minutes, seconds; 0.01 of a millimetre on the ground."""
    micro = round(abs(angle) * 3600 * 1_000_000)
    minutes, seconds = divmod(micro, 60_000_000)
    return _ratio(minutes // 60, 1), _ratio(minutes % 60, 1), IFDRational(seconds, 1_000_000)


def _seconds(utc: datetime) -> IFDRational:
    return IFDRational(utc.second * 1_000_000 + utc.microsecond, 1_000_000)


def _ratio(value: float, denominator: int) -> IFDRational:
    return IFDRational(round(value * denominator), denominator)
