"""OGC GeoPose 1.0 (21-056r11), Basic Quaternion: position in WGS 84 and orientation in east, north, up."""

import json
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from vgps.writers.export_job import ExportJob

# the body of a GeoPose: x forward, y left, z up, so that the identity looks east and is level
_CAMERA_R_BODY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def write_geopose(job: ExportJob, out: Path) -> None:
    """Write a JSON array with a GeoPose for every frame; heights are ellipsoidal, as the standard has them.

    Beside the standard's ``position`` and ``quaternion`` stand ``validTime`` (milliseconds of Unix time, as
    in its Advanced target), ``image`` and ``t_s``; the standard permits more keys.

    Raises:
        RunFolderError: The run is not georeferenced.
    """
    turned = Rotation.from_matrix(job.local_R_camera @ _CAMERA_R_BODY).as_quat(canonical=True)
    utc, poses = job.utc, []
    for row, ((latitude, longitude, height), q) in enumerate(
        zip(job.geodetic.tolist(), turned.tolist(), strict=True)
    ):
        pose: dict[str, object] = {
            "position": {"lat": round(latitude, 10), "lon": round(longitude, 10), "h": round(height, 4)},
            "quaternion": dict(zip("xyzw", q, strict=True)),
            "image": job.image_names[row],
            "t_s": round(float(job.solution.t_s[row]), 9),
        }
        if utc is not None:
            pose["validTime"] = round(utc[row].timestamp() * 1000)
        poses.append(pose)
    out.write_text(json.dumps(poses, indent=1) + "\n", encoding="utf-8")
