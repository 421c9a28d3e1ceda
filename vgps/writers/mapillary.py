"""The description JSON of mapillary_tools: `mapillary_tools upload --desc_path FILE IMAGES`."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from vgps.errors import RunFolderError
from vgps.writers.export_job import ExportJob


def write_mapillary(job: ExportJob, out: Path) -> None:
    """Write a description of every frame's image, with its instant on the clock of the GPS log.

    The estimated time offset is in the instants. Images are expected beside the file, named as in the other
    exports. Altitudes are above the geoid if one is given, as Mapillary shows them.

    Raises:
        RunFolderError: The run is not georeferenced, or the start of the video is unknown.
    """
    utc, heights = job.utc, job.coordinates[:, 2]
    if utc is None:
        raise RunFolderError(
            "the start of the video in UTC is unknown",
            expected="a time for every image",
            remedy="set video_start_utc in rig.yaml and run vgps smooth again",
        )
    sigma = np.hypot(*job.solution.sigma_position_m[:, :2].T)
    descriptions = []
    for row, (latitude, longitude, _) in enumerate(job.geodetic.tolist()):
        instant = utc[row].strftime("%Y_%m_%d_%H_%M_%S_") + f"{utc[row].microsecond // 1000:03d}"
        one: dict[str, Any] = {
            "filename": str(job.out.resolve().parent / job.image_names[row]),
            "filetype": "image",
            "MAPLatitude": round(latitude, 9),
            "MAPLongitude": round(longitude, 9),
            "MAPAltitude": round(float(heights[row]), 4),
            "MAPCaptureTime": instant,
        }
        if np.isfinite(job.heading_deg[row]):
            heading = round(float(job.heading_deg[row]), 4)
            one["MAPCompassHeading"] = {"TrueHeading": heading, "MagneticHeading": heading}
        if np.isfinite(sigma[row]):
            one["MAPGPSAccuracyMeters"] = round(float(sigma[row]), 4)
        descriptions.append(one)
    out.write_text(json.dumps(descriptions, indent=1) + "\n", encoding="utf-8")
